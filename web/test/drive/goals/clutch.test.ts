import { describe, expect, it } from "vitest";
import { Clutch, clutchOf } from "../../../src/drive/goals/clutch";
import type { AxisValue } from "../../../src/drive/goals/goal_range";
import { axisOf, descriptionOf, feedbackOf, goalAxisOf, stopOf } from "../../messages";
import { randomNumbers } from "../../random";
import { readVectors } from "../../vectors";

interface Step {
  readonly feedback?: {
    axes: number[];
    goals: number[];
    neutral_needed?: boolean;
    at_rest?: boolean;
    time?: number;
    event?: number;
  };
  readonly engage?: AxisValue[];
  readonly move?: AxisValue[];
  readonly release?: true;
  readonly lost?: "feedback" | "seat" | "arming";
  readonly goals?: AxisValue[];
  readonly clipped?: number[];
  readonly engaged: boolean;
}

interface Case {
  readonly name: string;
  readonly axes: readonly { scale: number; wrap: number | null; reach: number; settling?: number }[];
  readonly steps: readonly Step[];
}

const { cases } = readVectors("clutch") as { cases: Case[] };

/** `event`: of a feedback that names none. */
function play(clutch: Clutch, step: Step, event: number, about: string): void {
  if (step.feedback !== undefined) clutch.observe(feedbackOf(event, step.feedback));
  if (step.engage !== undefined) clutch.engage(step.engage);
  if (step.release === true) clutch.release();
  if (step.lost === "feedback") clutch.lostFeedback();
  else if (step.lost !== undefined) clutch.release();
  if (step.move !== undefined) {
    const goals = clutch.goals(step.move);
    const expected = step.goals ?? [];
    expect(goals.length, about).toBe(expected.length);
    for (const [at, goal] of goals.entries()) {
      const wanted = expected[at] ?? null;
      if (wanted === null) expect(goal, about).toBeNull();
      else expect(goal, about).toBeCloseTo(wanted, 9);
    }
    expect(clutch.clipped, about).toEqual(step.clipped);
  }
  expect(clutch.engaged, about).toBe(step.engaged);
}

describe("the clutch does what the shared cases say", () => {
  it.each(cases)("$name", ({ axes, steps }) => {
    const clutch = new Clutch(
      axes.map(({ scale, settling = 0, ...axis }, index) => ({ index, axis, scale, settling })),
    );
    steps.forEach((step, number) =>
      play(clutch, step, 10 * number + 10, `step ${number}: ${JSON.stringify(step)}`),
    );
  });
});

describe("a clutch", () => {
  it("is of the robot's goal axes, by name", () => {
    const robot = descriptionOf([axisOf("base"), goalAxisOf("elbow")]);
    expect(clutchOf(robot, [["base", 1]])).toBeNull();
    expect(clutchOf(robot, [["wrist", 1]])).toBeNull();
    expect(clutchOf(robot, [["elbow", NaN]])).toBeNull();
    const clutch = clutchOf(robot, [["elbow", -1]]);
    clutch?.observe(feedbackOf(1, { axes: [9, 1], goals: [null, 1] }));
    expect(clutch?.engage([4])).toBe(true);
    expect(clutch?.goals([4.25])).toEqual([0.75]);
  });

  it("engages at no stopped robot, and at no feedback without the axis' goal", () => {
    const clutch = new Clutch([{ index: 0, axis: { reach: 1, wrap: null }, scale: 1 }]);
    clutch.observe(feedbackOf(1, { axes: [0], goals: [0], stop: stopOf({ stopped: true }) }));
    expect(clutch.engage([0])).toBe(false);
    clutch.observe(feedbackOf(2, { axes: [0], goals: [null] }));
    expect(clutch.engage([0])).toBe(false);
    clutch.observe(feedbackOf(3, { axes: [], goals: [0] }));
    expect(clutch.engage([0])).toBe(false);
    clutch.observe(feedbackOf(3, { axes: [0], goals: [0] }));
    expect(clutch.engage([0, 1])).toBe(false);
    expect(clutch.engage([0])).toBe(true);
  });

  it("begins at the applied goal and stays within reach, whatever happens", () => {
    const random = randomNumbers(7);
    for (let run = 0; run < 200; run++) {
      const wrap = random() < 0.5 ? null : 6;
      const clutch = new Clutch([{ index: 0, axis: { reach: 1, wrap }, scale: 4 * random() - 2 }]);
      let place = { applied: 0, measured: 0 };
      for (let step = 0; step < 60; step++) {
        const device = [20 * random() - 10];
        const lot = random();
        if (lot < 0.4) {
          const applied = place.applied + random() - 0.5;
          place = { applied, measured: applied + 3 * random() - 1.5 };
          clutch.observe(feedbackOf(2 * step + 1, { axes: [place.measured], goals: [applied] }));
        } else if (lot < 0.5) clutch.release();
        else if (lot < 0.55) clutch.lostFeedback();
        else if (lot < 0.7) {
          const begins = clutch.engage(device);
          const [first = null] = clutch.goals(device);
          if (begins) expect(first).toBe(place.applied);
          else expect(first).toBeNull();
        }
        const [goal = null] = clutch.goals(device);
        if (goal === null) continue;
        const slack = 1e-9;
        expect(goal).toBeGreaterThan(
          nearby(Math.min(place.measured - 0.8, place.applied), goal, wrap) - slack,
        );
        expect(goal).toBeLessThan(nearby(Math.max(place.measured + 0.8, place.applied), goal, wrap) + slack);
      }
    }
  });
});

/** The same place, counted on by as many periods as the goal is. */
function nearby(place: number, goal: number, wrap: number | null): number {
  return wrap === null ? place : place + wrap * Math.round((goal - place) / wrap);
}
