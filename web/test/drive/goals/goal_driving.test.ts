import { describe, expect, it } from "vitest";
import { axisValues, neutralValues, type HeldInputs } from "../../../src/drive/axis_mapping";
import { GoalDriving, type GoalInputs } from "../../../src/drive/goals/goal_driving";
import type { AxisValue } from "../../../src/drive/goals/goal_range";
import type { ControlLayer } from "../../../src/protocol/wire";
import { axisOf, descriptionOf, feedbackOf, goalAxisOf, refusalOf } from "../../messages";
import { randomNumbers } from "../../random";

const axes = [axisOf("base"), goalAxisOf("elbow"), goalAxisOf("wrist", { slew: 2 })];
const description = descriptionOf(axes);
const binding = { pad: null, touch: null, invert_pad: false, invert_touch: false, scale: 1 };
const layer: ControlLayer = {
  name: "joints",
  label: "Joints",
  bindings: [
    { ...binding, axis: "base", key_positive: "KeyR", key_negative: "KeyF" },
    { ...binding, axis: "elbow", key_positive: "KeyW", key_negative: "KeyS" },
    { ...binding, axis: "wrist", key_positive: "KeyE", key_negative: "KeyD", scale: 0.5 },
  ],
};
const feedback = feedbackOf(5, { axes: [0, 1, -1], goals: [null, 1.05, -1] });
const later = { ...feedback, event: 7 };
const REST: readonly AxisValue[] = [0, null, null];

function heldOf(keys: readonly string[], travels: Record<string, number> = {}, pushes = {}): HeldInputs {
  return { pad: null, keys: new Set(keys), touch: null, sliders: { travels, pushes } };
}

function inputsOf(held: HeldInputs, rest: Partial<GoalInputs> = {}): GoalInputs {
  return { description, layer, held, share: 1, feedback, moves: true, ...rest };
}

function takeAt(driving: GoalDriving, inputs: GoalInputs, now: number): readonly AxisValue[] {
  return driving.take(axisValues(axes, layer, inputs.held, inputs.share), inputs, now);
}

describe("goal axes", () => {
  it("stay while nothing is held", () => {
    const driving = new GoalDriving();
    expect(neutralValues(axes)).toEqual(REST);
    expect(takeAt(driving, inputsOf(heldOf([])), 0)).toEqual(REST);
  });

  it("of a robot without any are none of its business", () => {
    const driving = new GoalDriving();
    const rates = descriptionOf([axisOf("base")]);
    expect(driving.take([0.5], inputsOf(heldOf([]), { description: rates }), 0)).toEqual([0.5]);
    expect(driving.speed).toBe(1);
  });

  it("are jogged by keys from the applied goal, beside the rates", () => {
    const driving = new GoalDriving();
    const held = heldOf(["KeyW", "KeyR"]);
    expect(takeAt(driving, inputsOf(held), 0)).toEqual([2, 1.05, null]);
    expect(takeAt(driving, inputsOf(held), 10)[1]).toBeCloseTo(1.06);
    expect(takeAt(driving, inputsOf(heldOf([])), 20)).toEqual(REST);
  });

  it("are moved on by a touch stick, as far as it is pushed and the way its binding says", () => {
    const touched: ControlLayer = {
      ...layer,
      bindings: [
        { ...binding, axis: "elbow", touch: "left_y", key_positive: "", key_negative: "" },
        {
          ...binding,
          axis: "wrist",
          touch: "right_x",
          invert_touch: true,
          key_positive: "",
          key_negative: "",
        },
      ],
    };
    const driving = new GoalDriving();
    const touch = { left_x: 0, left_y: 1, right_x: 0.5, right_y: 0 };
    const inputs = inputsOf({ ...heldOf([]), touch }, { layer: touched });
    const take = (now: number): readonly AxisValue[] =>
      driving.take(axisValues(axes, touched, inputs.held, inputs.share), inputs, now);
    expect(take(0)).toEqual([0, 1.05, -1]);
    const [, elbow, wrist] = take(40);
    expect(elbow).toBeCloseTo(1.09); // 1 rad/s
    expect(wrist).toBeCloseTo(-1.04); // half of 2 rad/s, turned round
  });

  it("ask for no more speed than the hand does", () => {
    const driving = new GoalDriving();
    takeAt(driving, inputsOf(heldOf(["KeyE"])), 0);
    expect(driving.speed).toBe(0.5);
    takeAt(driving, inputsOf(heldOf(["KeyE"]), { share: 0.3 }), 10);
    expect(driving.speed).toBeCloseTo(0.15);
    takeAt(driving, inputsOf(heldOf(["KeyE", "KeyW"])), 20);
    expect(driving.speed).toBe(1);
    takeAt(driving, inputsOf(heldOf([], { elbow: 0 }), { share: 0.3 }), 30);
    expect(driving.speed).toBeCloseTo(0.3);
  });

  it("follow a slider as far as it is dragged, and stay when it is let go", () => {
    const driving = new GoalDriving();
    expect(takeAt(driving, inputsOf(heldOf([], { elbow: 0.4 })), 0)[1]).toBe(1.05);
    expect(takeAt(driving, inputsOf(heldOf([], { elbow: 0.45 })), 10)[1]).toBeCloseTo(1.25); // of 4 rad
    expect(takeAt(driving, inputsOf(heldOf([], { elbow: 1 })), 20)[1]).toBeCloseTo(1.4); // 0.8 of reach
    expect(takeAt(driving, inputsOf(heldOf([])), 30)).toEqual(REST);
    const again = heldOf([], { elbow: -0.2 });
    expect(takeAt(driving, inputsOf(again), 40)[1]).toBeNull(); // a goal may be under way
    expect(driving.saysWhatItWaitsFor(40)).toBe(false); // yet
    expect(driving.saysWhatItWaitsFor(340)).toBe(true);
    expect(takeAt(driving, inputsOf(again, { feedback: later }), 350)[1]).toBe(1.05);
    expect(driving.saysWhatItWaitsFor(700)).toBe(false);
  });

  it("are pushed by arrow keys on a slider, which wins over its layer's keys", () => {
    const driving = new GoalDriving();
    const held = heldOf(["KeyS"], {}, { elbow: 1 });
    expect(takeAt(driving, inputsOf(held), 0)[1]).toBe(1.05);
    expect(takeAt(driving, inputsOf(held), 10)[1]).toBeCloseTo(1.06);
  });

  it("follow a device, which is let go whenever nothing may move", () => {
    const driving = new GoalDriving();
    let released = 0;
    driving.device = { goals: () => [9, 1.3, null], release: () => (released += 1), waits: false };
    expect(takeAt(driving, inputsOf(heldOf(["KeyE"])), 0)).toEqual([0, 1.3, -1]);
    expect(driving.speed).toBe(1);
    const before = released;
    takeAt(driving, inputsOf(heldOf([]), { moves: false }), 10);
    expect(released).toBe(before + 1);
  });

  it.each([
    ["the next command may not move", { moves: false }],
    ["there is no feedback", { feedback: null }],
    ["the feedback has no goals", { feedback: feedbackOf(6, { axes: [0, 1, -1] }) }],
    ["the position is not known", { feedback: feedbackOf(6, { ...feedback, unknown: ["elbow"] }) }],
  ] as const)("stay and begin anew when %s", (_, lost) => {
    const driving = new GoalDriving();
    for (const held of [heldOf(["KeyW"]), heldOf([], { elbow: 0.1 })]) {
      for (let now = 0; now < 100; now += 10) takeAt(driving, inputsOf(held), now);
      const rates = neutralValues(axes);
      expect(driving.take(rates, inputsOf(held, lost), 100)[1]).toBeNull();
      expect(takeAt(driving, inputsOf(held, { feedback: later }), 110)[1]).toBe(1.05);
      driving.release();
    }
  });

  it("begin anew at another robot, and after a refused goal, which is remembered for a while", () => {
    const driving = new GoalDriving();
    const held = heldOf(["KeyW"]);
    for (let now = 0; now < 100; now += 10) takeAt(driving, inputsOf(held), now);
    driving.refused(refusalOf(6, "late"), 100);
    expect(driving.refusal).toBeNull();
    driving.refused(refusalOf(6, "jump"), 100);
    expect(driving.refusal).toEqual({ reason: "jump", detail: "", atMs: 100 });
    expect(takeAt(driving, inputsOf(held), 110)[1]).toBe(1.05);
    takeAt(driving, inputsOf(held), 120);
    const other = descriptionOf([axisOf("base"), goalAxisOf("elbow"), goalAxisOf("wrist")]);
    expect(takeAt(driving, inputsOf(held, { description: other }), 130)[1]).toBe(1.05);
  });

  it("have applied goals that never jump, whatever is held, lost, refused and late", () => {
    const random = randomNumbers(11);
    for (let run = 0; run < 100; run++) {
      const driving = new GoalDriving();
      let applied = 2 * random() - 1;
      let news = feedbackOf(1, { axes: [0, applied, 0], goals: [null, applied, 0] });
      let last: AxisValue = null;
      for (let now = 0; now < 2000; now += 10) {
        const held = heldOf(
          random() < 0.4 ? ["KeyW"] : random() < 0.3 ? ["KeyS"] : [],
          random() < 0.3 ? { elbow: 4 * random() - 2 } : {},
        );
        const moves = random() > 0.1;
        if (random() < 0.02) driving.refused(refusalOf(2, random() < 0.5 ? "jump" : "conflict"), now);
        const [, goal = null] = takeAt(driving, inputsOf(held, { feedback: news, moves }), now);
        if (!moves) expect(goal).toBeNull();
        if (goal !== null && last === null) expect(goal).toBe(news.goals[1]);
        if (goal !== null) {
          const measured = news.axes[1] ?? 0;
          expect(Math.abs(goal - measured)).toBeLessThanOrEqual(
            Math.max(0.4, Math.abs(measured - (news.goals[1] ?? 0))) + 1e-9,
          );
        }
        last = goal;
        if (random() < 0.3) {
          applied += goal === null ? 0 : Math.max(-0.02, Math.min(0.02, goal - applied));
          const measured = applied + 0.05 * (random() - 0.5);
          news = feedbackOf(now + 2, { axes: [0, measured, 0], goals: [null, applied, 0] });
        }
      }
    }
  });
});

describe("the rotation of a pose", () => {
  const names = ["rx", "ry", "rz"] as const;
  const arm = names.map((name) => goalAxisOf(name, { minimum: -4, maximum: 4, reach: 8 }));
  const pose = {
    ...{ name: "tool", label: "Tool", body: "hand", frame: "", point: [0, 0, 0] as const },
    ...{ position: ["", "", ""] as const, rotation: names, instead_of: [], settling: 0 },
  };
  const robot = { ...descriptionOf(arm), poses: [pose] };
  const bindings = names.map((axis, at) => ({
    ...{ ...binding, axis },
    ...{ key_positive: ["KeyQ", "KeyW", "KeyE"][at] ?? "", key_negative: "" },
  }));
  const down = feedbackOf(5, { axes: [0, 1.6, 0], goals: [0, 1.5, 0] });
  const inputs = (held: HeldInputs): GoalInputs => ({
    ...inputsOf(held, { description: robot }),
    ...{ feedback: down, layer: { name: "tool", label: "Tool", bindings } },
  });
  const rest: readonly AxisValue[] = [null, null, null];

  it("is turned by keys about the axes of its frame, and stays when they are let go", () => {
    const driving = new GoalDriving();
    expect(driving.take(rest, inputs(heldOf(["KeyQ"])), 0)).toEqual([0, 1.5, 0]);
    const [rx, ry, rz] = driving.take(rest, inputs(heldOf(["KeyQ"])), 10);
    expect(rx).toBeGreaterThan(0.005);
    expect(ry).toBeCloseTo(1.5, 3);
    expect(rz).toBeGreaterThan(0.005); // its component of a turn about x, where it points down
    expect(driving.speed).toBeGreaterThan(0.7);
    expect(driving.take(rest, inputs(heldOf([])), 20)).toEqual(rest);
    driving.take(rest, inputs(heldOf(["KeyQ"])), 30);
    driving.release();
    expect(driving.take(rest, inputs(heldOf(["KeyQ"])), 40)).toEqual([0, 1.5, 0]);
  });

  it("is moved by one component where a slider of it is dragged, or left to the device that leads it", () => {
    const driving = new GoalDriving();
    driving.take(rest, inputs(heldOf(["KeyQ"], { rz: 0 })), 0);
    const [rx, ry, rz] = driving.take(rest, inputs(heldOf(["KeyQ"], { rz: 0.01 })), 10);
    expect([rx, ry]).toEqual([0.01, null]);
    expect(rz).toBeCloseTo(0.08);
    driving.device = { goals: () => [0.1, 0.2, 0.3], release: () => undefined, waits: false };
    expect(driving.take(rest, inputs(heldOf(["KeyQ"])), 20)).toEqual([0.1, 0.2, 0.3]);
  });
});

describe("a pose that a device drives", () => {
  it("keeps still the axes that it stands for, whatever is held", () => {
    const names = ["x", "y", "z"] as const;
    const arm = [goalAxisOf("elbow"), ...names.map((name) => goalAxisOf(name))];
    const pose = {
      ...{ name: "tool", label: "Tool", body: "hand", frame: "", point: [0, 0, 0] as const },
      ...{ position: names, rotation: ["", "", ""] as const, instead_of: ["elbow"], settling: 0 },
    };
    const robot = { ...descriptionOf(arm), poses: [pose] };
    const driving = new GoalDriving();
    const places = feedbackOf(5, { axes: [1, 0, 0, 0], goals: [1, 0, 0, 0] });
    const inputs = inputsOf(heldOf(["KeyW"]), { description: robot, feedback: places });
    expect(driving.take([null, null, null, null], inputs, 0)).toEqual([1, null, null, null]);
    driving.device = { goals: () => [null, 0.1, 0.2, 0.3], release: () => undefined, waits: false };
    expect(driving.take([null, null, null, null], inputs, 10)).toEqual([null, 0.1, 0.2, 0.3]);
  });

  it("is said to wait when its own clutch has done so for a while, until nobody may drive", () => {
    const driving = new GoalDriving();
    driving.device = { goals: () => REST, release: () => undefined, waits: true };
    for (const now of [0, 200, 400]) takeAt(driving, inputsOf(heldOf([])), now);
    expect(driving.saysWhatItWaitsFor(400)).toBe(true);
    takeAt(driving, inputsOf(heldOf([]), { moves: false }), 410);
    expect(driving.saysWhatItWaitsFor(410)).toBe(false);
  });

  it("leaves nothing behind for a slider that was held meanwhile, of its own axes or of those it stands for", () => {
    const names = ["x", "y", "z"] as const;
    const arm = [goalAxisOf("elbow"), ...names.map((name) => goalAxisOf(name))];
    const pose = {
      ...{ name: "tool", label: "Tool", body: "hand", frame: "", point: [0, 0, 0] as const },
      ...{ position: names, rotation: ["", "", ""] as const, instead_of: ["elbow"], settling: 0 },
    };
    const robot = { ...descriptionOf(arm), poses: [pose] };
    const driving = new GoalDriving();
    const rest = [null, null, null, null];
    const at = (place: number, held: HeldInputs): GoalInputs => ({
      ...inputsOf(held, { description: robot }),
      feedback: feedbackOf(5, { axes: [place, place, 0, 0], goals: [place, place, 0, 0] }),
    });
    for (const name of ["elbow", "x"]) {
      const held = heldOf([], { [name]: 0.1 });
      driving.device = { goals: () => [null, 0.1, 0.2, 0.3], release: () => undefined, waits: false };
      driving.take(rest, at(0, held), 0);
      driving.take(rest, at(0.3, held), 10);
      driving.device = null;
      expect(driving.take(rest, at(0.3, held), 20)[name === "x" ? 1 : 0]).toBe(0.3);
      driving.release();
    }
  });
});
