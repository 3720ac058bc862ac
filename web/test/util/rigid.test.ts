import { describe, expect, it } from "vitest";
import {
  about,
  heading,
  inverse,
  multiply,
  nearestRotationVector,
  ofRotationVector,
  rotate,
  rotationVector,
  type Vector,
} from "../../src/util/rigid";
import { randomNumbers } from "../random";

function expectVector(found: readonly number[], expected: readonly number[]): void {
  expect(found.length).toBe(expected.length);
  for (const [at, value] of expected.entries()) expect(found[at]).toBeCloseTo(value, 6);
}

describe("a rotation", () => {
  it("turns counter-clockwise about its axis", () => {
    expectVector(rotate(about([0, 0, 1], Math.PI / 2), [1, 0, 0]), [0, 1, 0]);
  });

  it("is undone by its inverse, and first turns by the right one", () => {
    const one = about([0, 0, 1], Math.PI / 2);
    const other = about([1, 0, 0], Math.PI / 2);
    expectVector(rotate(multiply(other, one), [1, 0, 0]), [0, 0, 1]);
    expectVector(rotate(multiply(inverse(one), one), [1, 2, 3]), [1, 2, 3]);
  });

  it("and its rotation vector mean the same", () => {
    const random = randomNumbers(7);
    for (let turn = 0; turn < 200; turn++) {
      const vector = [0, 1, 2].map(() => (random() - 0.5) * 3) as unknown as Vector;
      expectVector(rotationVector(ofRotationVector(vector)), vector);
    }
    expectVector(rotationVector([0, 0, 0, 1]), [0, 0, 0]);
    expectVector(rotationVector(about([0, 0, 1], 1.5 * Math.PI)), [0, 0, -0.5 * Math.PI]);
  });
});

describe("the nearest rotation vector", () => {
  it("goes on past half a revolution instead of coming out at the other side", () => {
    let last: Vector = [0, 0, 0];
    for (let step = 1; step <= 100; step++) {
      const angle = step * 0.1;
      last = nearestRotationVector(rotationVector(about([0, 0, 1], angle)), last);
      expectVector(last, [0, 0, angle]);
    }
  });

  it("of no turn is no turn, or whole revolutions about the same axis", () => {
    expectVector(nearestRotationVector([0, 0, 0], [0, 0, 0]), [0, 0, 0]);
    expectVector(nearestRotationVector([0, 0, 0], [0, 6.2, 0]), [0, 2 * Math.PI, 0]);
  });
});

describe("a heading", () => {
  it("is 0 ahead and positive to the left, also when the head is tilted", () => {
    expect(heading([0, 0, 0, 1])).toBeCloseTo(0);
    expect(heading(about([0, 1, 0], 0.7))).toBeCloseTo(0.7);
    expect(heading(multiply(about([0, 1, 0], -0.7), about([1, 0, 0], 0.5)))).toBeCloseTo(-0.7);
  });

  it("of who looks straight down is where the top of the head points", () => {
    expect(heading(multiply(about([0, 1, 0], 0.4), about([1, 0, 0], -Math.PI / 2)))).toBeCloseTo(0.4);
  });
});
