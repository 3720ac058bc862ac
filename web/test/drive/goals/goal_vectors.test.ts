import { describe, expect, it } from "vitest";
import { neutralValues } from "../../../src/drive/axis_mapping";
import { Clutch } from "../../../src/drive/goals/clutch";
import { wayTo, type AxisValue } from "../../../src/drive/goals/goal_range";
import type { Axis } from "../../../src/protocol/wire";
import { axisOf, feedbackOf } from "../../messages";
import { readVectors } from "../../vectors";

interface Step {
  readonly do: "feedback" | "engage" | "device" | "release" | "lost";
  readonly goal?: AxisValue;
  readonly device?: number;
  readonly value: AxisValue;
}

interface Vectors {
  readonly axes: readonly (Partial<Axis> & { readonly name: string })[];
  readonly meaning: readonly { name: string; values: AxisValue[]; is: string }[];
  readonly ways: readonly { place: number; goal: number; wrap: number; way: number }[];
  readonly clutch: readonly { name: string; scale: number; steps: readonly Step[] }[];
}

const vectors = readVectors("goals") as Vectors;
const axes = vectors.axes.map((each) => axisOf(each.name, each));

describe("goal axes mean to the page what they mean to the bridge", () => {
  it.each(vectors.meaning.filter(({ is }) => is === "neutral" || is === "moves"))(
    "$name",
    ({ values, is }) => {
      const neutral = neutralValues(axes);
      expect(values.every((value, at) => value === neutral[at])).toBe(is === "neutral");
    },
  );

  it.each(vectors.ways)("from $place to $goal the way is $way", ({ place, goal, wrap, way }) => {
    expect(wayTo({ wrap }, place, goal)).toBeCloseTo(way, 9);
  });
});

describe("the clutch does what the bridge's cases say", () => {
  it.each(vectors.clutch)("$name", ({ scale, steps }) => {
    const clutch = new Clutch([{ index: 0, axis: { reach: Infinity, wrap: null }, scale }]);
    let device: AxisValue = null;
    for (const [number, step] of steps.entries()) {
      const found = { axes: [0], goals: [step.goal ?? null] };
      if (step.do === "feedback") clutch.observe(feedbackOf(10 * number + 10, found));
      device = step.device ?? device;
      if (step.do === "engage") clutch.engage([device]);
      if (step.do === "release") clutch.release();
      if (step.do === "lost") clutch.lostFeedback();
      const [goal = null] = clutch.goals([device]);
      if (step.value === null) expect(goal, JSON.stringify(step)).toBeNull();
      else expect(goal, JSON.stringify(step)).toBeCloseTo(step.value, 9);
    }
  });
});
