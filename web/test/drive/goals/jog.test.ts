import { describe, expect, it } from "vitest";
import { createJog, stepJog, type AxisPlace } from "../../../src/drive/goals/jog";
import { REACH_SHARE, wayTo } from "../../../src/drive/goals/goal_range";
import { goalAxisOf } from "../../messages";
import { randomNumbers } from "../../random";

const axis = goalAxisOf("elbow", { minimum: -2, maximum: 2, slew: 1, acceleration: 4, reach: 0.5 });
const at = (applied: number, measured = applied): AxisPlace => ({ applied, measured });

describe("a jogged goal", () => {
  it("is null until somebody moves it, and again when let go", () => {
    const jog = createJog();
    expect(stepJog(jog, axis, 0, at(1), 0)).toBeNull();
    expect(stepJog(jog, axis, 1, at(1), 10)).toBe(1);
    expect(stepJog(jog, axis, 0, at(1), 20)).toBeNull();
    expect(stepJog(jog, axis, NaN, at(1), 30)).toBeNull();
  });

  it("begins at the applied goal, however long nobody moved it", () => {
    const jog = createJog();
    expect(stepJog(jog, axis, 1, at(0.7, 0.6), 60_000)).toBe(0.7);
    expect(stepJog(jog, axis, 1, at(0.7, 0.6), 60_010)).toBeCloseTo(0.71);
    stepJog(jog, axis, 0, at(0.7), 60_020);
    expect(stepJog(jog, axis, 1, at(0.705), 60_030)).toBe(0.705);
  });

  it("moves on at the rate, and leads the applied one by a little", () => {
    const jog = createJog();
    for (let now = 0; now <= 100; now += 10) stepJog(jog, axis, 0.5, at(0), now);
    expect(jog.goal).toBeCloseTo(0.05);
    for (let now = 110; now <= 5000; now += 10) stepJog(jog, axis, 0.5, at(0), now);
    expect(jog.goal).toBeCloseTo(0.75 * REACH_SHARE * axis.reach);
    for (let now = 5000; now <= 9000; now += 10) stepJog(jog, axis, 0.1, at(0), now);
    expect(jog.goal).toBeCloseTo(0.08, 2); // 0.8 s of a slow push
  });

  it("does not make up for a page that was held up", () => {
    const jog = createJog();
    stepJog(jog, axis, 1, at(0), 0);
    expect(stepJog(jog, axis, 1, at(0), 3000)).toBeLessThanOrEqual(0.05);
  });

  it("turns round at once", () => {
    const jog = createJog();
    for (let now = 0; now <= 500; now += 10) stepJog(jog, axis, 1, at(0), now);
    expect(jog.goal).toBeGreaterThan(0.1);
    expect(stepJog(jog, axis, -1, at(0), 510)).toBeCloseTo(-0.01);
  });

  it("ends at the end of the axis", () => {
    const jog = createJog();
    for (let now = 0; now <= 1000; now += 10) stepJog(jog, axis, 1, at(1.9), now);
    expect(jog.goal).toBeCloseTo(2);
  });

  it("of an axis that is outside of its limits moves back alone", () => {
    const jog = createJog();
    for (let now = 0; now <= 200; now += 10) stepJog(jog, axis, 1, at(2.5), now);
    expect(jog.goal).toBe(2.5);
    for (let now = 210; now <= 400; now += 10) stepJog(jog, axis, -1, at(2.5), now);
    expect(jog.goal).toBeLessThan(2.5);
  });

  it("stays near the measured value: an arm that cannot follow is not led away", () => {
    const jog = createJog();
    for (let now = 0; now <= 2000; now += 10) stepJog(jog, axis, 1, at(0.35, 0), now);
    expect(jog.goal).toBeCloseTo(0.4);
    for (let now = 0; now <= 2000; now += 10) stepJog(jog, axis, 1, at(0.45, 0), now);
    expect(jog.goal).toBeCloseTo(0.45);
  });

  it("does not move where the place is not known", () => {
    const jog = createJog();
    stepJog(jog, axis, 1, at(0), 0);
    expect(stepJog(jog, axis, 1, null, 10)).toBeNull();
    expect(stepJog(jog, axis, 1, at(0.3), 20)).toBe(0.3);
  });

  it("of an axis without ends goes on across the border", () => {
    const turning = goalAxisOf("table", { minimum: -3, maximum: 3, wrap: 6, reach: 1 });
    const jog = createJog();
    stepJog(jog, turning, 1, at(2.99), 0);
    for (let now = 10; now <= 50; now += 10) stepJog(jog, turning, 1, at(2.99), now);
    expect(jog.goal).toBeCloseTo(3.04);
    expect(wayTo(turning, -2.98, jog.goal ?? 0)).toBeCloseTo(0.02);
    expect(stepJog(jog, turning, 1, at(-2.98), 60)).toBeCloseTo(-2.95);
  });

  it("never jumps: each goal is within the lead of the newest applied one, whatever the inputs and delays", () => {
    const random = randomNumbers(3);
    for (let run = 0; run < 300; run++) {
      const wrap = random() < 0.3 ? 4 : null;
      const some = goalAxisOf("x", { wrap, reach: random(), slew: 2 * random(), acceleration: 5 * random() });
      const jog = createJog();
      let place = at(4 * random() - 2);
      let now = 0;
      for (let step = 0; step < 80; step++) {
        now += random() < 0.05 ? 500 * random() : 12 * random();
        const rate = random() < 0.3 ? 0 : (2 * random() - 1) * some.slew;
        const began = jog.goal === null;
        const goal = stepJog(jog, some, rate, place, now);
        expect(goal === null).toBe(rate === 0);
        if (goal !== null) {
          const way = wayTo(some, place.applied, goal);
          if (began) expect(goal).toBe(place.applied);
          expect(Math.sign(rate) * way).toBeGreaterThanOrEqual(-1e-9);
          expect(Math.abs(way)).toBeLessThanOrEqual(0.75 * REACH_SHARE * some.reach + 1e-9);
          const off = Math.abs(wayTo(some, place.measured, goal));
          const was = Math.abs(wayTo(some, place.measured, place.applied));
          expect(off).toBeLessThanOrEqual(Math.max(REACH_SHARE * some.reach, was) + 1e-9);
        }
        if (random() < 0.3) {
          const applied = place.applied + (goal === null ? 0 : random() * wayTo(some, place.applied, goal));
          place = at(applied, applied + (random() - 0.5) * 0.3);
        }
      }
    }
  });
});
