import { describe, expect, it } from "vitest";
import type { AxisPlace } from "../../../src/drive/goals/jog";
import { createTurnJog, stepTurn, type Three } from "../../../src/drive/goals/turn_jog";
import { inverse, multiply, ofRotationVector, rotationVector, type Vector } from "../../../src/util/rigid";
import { goalAxisOf } from "../../messages";
import { randomNumbers } from "../../random";

const END = 1.5 * Math.PI;
const turning = { minimum: -END, maximum: END, slew: 1.2, acceleration: 4.8, reach: END + Math.PI };
const axes = [goalAxisOf("rx", turning), goalAxisOf("ry", turning), goalAxisOf("rz", turning)] as const;
const DOWN: Vector = [0, Math.PI / 2, 0];

function at(applied: Vector, measured: Vector = applied): Three<AxisPlace> {
  const place = (part: 0 | 1 | 2): AxisPlace => ({ applied: applied[part], measured: measured[part] });
  return [place(0), place(1), place(2)];
}

/** How a rotation has turned since `from`, in the frame. */
function turnSince(from: Vector, to: Vector): Vector {
  return rotationVector(multiply(ofRotationVector(to), inverse(ofRotationVector(from))));
}

/** A robot leads each component to its goal by itself, no faster than `speed` allows, and tells it some steps later. */
function turnedBy(from: Vector, rates: Vector, steps: number, delay = 0): Vector[] {
  const jog = createTurnJog();
  const applied: Vector[] = [from];
  for (let step = 0; step < steps; step += 1) {
    const { goals, speed } = stepTurn(
      jog,
      axes,
      rates,
      at(applied[Math.max(0, step - delay)] ?? from),
      step * 10,
    );
    const here = applied[step] ?? from;
    const next = here.map((value, part) => {
      const way = (goals[part] ?? value) - value;
      return value + Math.sign(way) * Math.min(Math.abs(way), 1.2 * speed * 0.01);
    });
    applied.push([next[0] ?? 0, next[1] ?? 0, next[2] ?? 0]);
  }
  return applied;
}

describe("a turned pose", () => {
  it("stays until somebody turns it, and again when let go", () => {
    const jog = createTurnJog();
    expect(stepTurn(jog, axes, [0, 0, 0], at(DOWN), 0).goals).toEqual([null, null, null]);
    expect(stepTurn(jog, axes, [1, 0, 0], at(DOWN), 10).goals).toEqual(DOWN);
    expect(stepTurn(jog, axes, [1, 0, 0], at(DOWN), 20).goals).not.toEqual(DOWN);
    expect(stepTurn(jog, axes, [0, 0, 0], at(DOWN), 30)).toEqual({ goals: [null, null, null], speed: 0 });
    expect(stepTurn(jog, axes, [1, 0, 0], at(DOWN), 40).goals).toEqual(DOWN);
    expect(stepTurn(jog, axes, [1, 0, 0], null, 50).goals).toEqual([null, null, null]);
    expect(stepTurn(jog, axes, [NaN, 0, 0], at(DOWN), 60).goals).toEqual([null, null, null]);
  });

  it("turns about the axis of its frame, wherever it points", () => {
    for (const from of [[0, 0, 0], DOWN, [0.4, -1.1, 2], [-2, 0, 1.5], [0, 0, 3]] as const)
      for (const part of [0, 1, 2] as const)
        for (const [sign, delay] of [
          [1, 0],
          [-1, 20],
        ] as const) {
          const rates: [number, number, number] = [0, 0, 0];
          rates[part] = 0.6 * sign;
          const turn = turnSince(from, turnedBy(from, rates, 100, delay).at(-1) ?? from);
          const off = Math.hypot(...turn.map((value, at) => (at === part ? 0 : value)));
          expect(sign * turn[part], `${from.join()} ${part}`).toBeGreaterThan(0.2);
          expect(off, `${from.join()} ${part}`).toBeLessThan(0.05 * Math.hypot(...turn));
        }
  });

  it("turns as fast as it is asked to, where its components can", () => {
    const applied = turnedBy(DOWN, [0.6, 0, 0], 101);
    const speed = turnSince(applied[50] as Vector, applied[100] as Vector)[0] / 0.5;
    expect(speed).toBeGreaterThan(0.5);
    expect(speed).toBeLessThan(0.7);
  });

  it("goes on through half a turn, and ends at the axes' bounds", () => {
    const applied = turnedBy(DOWN, [0, 1.2, 0], 600);
    const steps = applied.slice(1).map((goal, step) => Math.abs(goal[1] - (applied[step] as Vector)[1]));
    expect(Math.max(...steps)).toBeLessThan(0.0121);
    expect((applied.at(-1) as Vector)[1]).toBeCloseTo(END, 2);
  });

  it("is never told to go further than the lead, or beyond a bound, whatever the inputs and delays", () => {
    const random = randomNumbers(4);
    for (let run = 0; run < 50; run += 1) {
      const jog = createTurnJog();
      let applied: Vector = [random() * 4 - 2, random() * 4 - 2, random() * 4 - 2];
      for (let step = 0; step < 60; step += 1) {
        const rates: Vector = [random() - 0.5, random() - 0.5, random() < 0.3 ? 0 : random() - 0.5];
        const { goals, speed } = stepTurn(jog, axes, rates, at(applied), step * 40 * random());
        const goal: Vector = [goals[0] ?? 0, goals[1] ?? 0, goals[2] ?? 0];
        expect(Math.max(...goal.map(Math.abs))).toBeLessThanOrEqual(END + 1e-6);
        expect(Math.hypot(...turnSince(applied, goal))).toBeLessThan(1.2);
        expect(speed).toBeLessThanOrEqual(1);
        const share = random();
        const part = (at: 0 | 1 | 2): number => applied[at] + share * (goal[at] - applied[at]);
        applied = [part(0), part(1), part(2)];
      }
    }
  });
});
