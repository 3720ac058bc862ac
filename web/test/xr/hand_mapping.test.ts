import { describe, expect, it } from "vitest";
import { baseFrame, baseFromSpace, bindHand, DEFAULT_HAND, handValues } from "../../src/xr/hand_mapping";
import { about, multiply, rotate, type Quaternion, type RigidPose, type Vector } from "../../src/util/rigid";

const STILL: Quaternion = [0, 0, 0, 1];

function handAt(position: Vector, orientation: Quaternion = STILL): RigidPose {
  return { position, orientation };
}

function expectVector(found: readonly number[], expected: readonly number[]): void {
  expect(found.length).toBe(expected.length);
  for (const [at, value] of expected.entries()) expect(found[at]).toBeCloseTo(value, 6);
}

describe("the headset's space", () => {
  it("has ahead, left and up where the base has x, y and z", () => {
    const turn = baseFromSpace(0, DEFAULT_HAND);
    expectVector(rotate(turn, [0, 0, -1]), [1, 0, 0]);
    expectVector(rotate(turn, [-1, 0, 0]), [0, 1, 0]);
    expectVector(rotate(turn, [0, 1, 0]), [0, 0, 1]);
  });

  it("has the operator's own ahead there, whichever way the operator faces", () => {
    const forward = 1.1;
    const ahead = rotate(about([0, 1, 0], forward), [0, 0, -1]);
    expectVector(rotate(baseFromSpace(forward, DEFAULT_HAND), ahead), [1, 0, 0]);
  });

  it("has ahead where the camera looks: one that faces the robot turns ahead and left round, and up not", () => {
    const turn = baseFromSpace(0, { ...DEFAULT_HAND, view: Math.PI });
    expectVector(rotate(turn, [0, 0, -1]), [-1, 0, 0]);
    expectVector(rotate(turn, [-1, 0, 0]), [0, -1, 0]);
    expectVector(rotate(turn, [0, 1, 0]), [0, 0, 1]);
  });
});

describe("a hand", () => {
  const start = handAt([0.2, 1.3, -0.4], about([0, 1, 0], 0.8));

  it("says at the start that nothing has moved, whatever its pose is", () => {
    const binding = bindHand(start, [0.3, -0.2, 2.9], baseFrame(0.5, DEFAULT_HAND), DEFAULT_HAND);
    expectVector(handValues(binding, start), [0, 0, 0, 0.3, -0.2, 2.9]);
  });

  it("says at the start a rotation beyond half a revolution as the robot says it", () => {
    const binding = bindHand(start, [0, 0, 3.8], baseFrame(0, DEFAULT_HAND), DEFAULT_HAND);
    expectVector(handValues(binding, start), [0, 0, 0, 0, 0, 3.8]);
  });

  it("moves the tool by its own way, times the scale", () => {
    const binding = bindHand(start, [0, 0, 0], baseFrame(0, { ...DEFAULT_HAND, scale: 0.5 }), {
      ...DEFAULT_HAND,
      scale: 0.5,
    });
    const moved = handAt([0.3, 1.5, -0.8], start.orientation);
    expectVector(handValues(binding, moved), [0.2, -0.05, 0.1, 0, 0, 0]);
  });

  it("turns the tool about the base's axes as it turns itself, from where the tool was", () => {
    const tool: Vector = [0.4, 0, 0];
    const binding = bindHand(start, tool, baseFrame(0, DEFAULT_HAND), DEFAULT_HAND);
    const turned = handAt(start.position, multiply(about([0, 1, 0], 0.6), start.orientation)); // to the left
    const [, , , rx = 0, ry = 0, rz = 0] = handValues(binding, turned);
    const expected = multiply(about([0, 0, 1], 0.6), about([1, 0, 0], 0.4));
    const angle = Math.hypot(rx, ry, rz);
    const found = about([rx / angle, ry / angle, rz / angle], angle);
    expectVector(rotate(found, [1, 2, 3]), rotate(expected, [1, 2, 3]));
  });

  it("goes on turning past half a revolution without a jump", () => {
    const binding = bindHand(start, [0, 0, 0], baseFrame(0, DEFAULT_HAND), DEFAULT_HAND);
    for (let angle = 0; angle < 7; angle += 0.1) {
      const turned = handAt(start.position, multiply(about([0, 1, 0], angle), start.orientation));
      expect(handValues(binding, turned)[5]).toBeCloseTo(angle, 6);
    }
  });

  it("keeps still what is locked", () => {
    const locked = { x: false, y: true, z: true, rotation: true };
    const binding = bindHand(start, [0.1, 0.2, 0.3], baseFrame(0, { ...DEFAULT_HAND, locked }), {
      ...DEFAULT_HAND,
      locked,
    });
    const moved = handAt([1, 2, -0.9], about([1, 0, 0], 1));
    expectVector(handValues(binding, moved), [0.5, 0, 0, 0.1, 0.2, 0.3]);
  });
});
