import { describe, expect, it } from "vitest";
import { ageWords, beyondBounds, goalParameters, pathPoints, placeOf, scanOf } from "../../src/map/map_state";
import type { Action, Feedback, Navigation, RobotDescription } from "../../src/protocol/wire";
import { axisOf, descriptionOf, feedbackOf } from "../messages";

const number = (name: string): Action["parameters"][number] => ({
  ...{ name, label: name, kind: "number", unit: "m", minimum: -4, maximum: 4, choices: [], default: null },
});
const GO: Action = {
  ...{ name: "go_to", label: "Go to", moves: true, confirm: "" },
  parameters: [number("x"), number("y"), number("yaw")],
};
const ROBOT: RobotDescription = {
  ...descriptionOf([axisOf("vx")]),
  joints: ["lift", "x", "y", "yaw"].map((name) => ({ name, unit: "m", minimum: null, maximum: null })),
  map: { x: "x", y: "y", yaw: "yaw", radius: 0.3, goal: "go_to" },
  actions: [GO],
};
const NAVIGATION: Navigation = {
  ...{ type: "navigation", event: 7, map: "ab", map_age: 0, located: true },
  ...{ frame: [1, 0, Math.PI / 2], goal: [], path: [], path_age: 0 },
};

function feedback(change: Partial<Feedback> = {}): Feedback {
  return { ...feedbackOf(9), joints: [5, 2, 0, 0], ...change };
}

describe("the robot's place on the map", () => {
  it("is the measured pose of the newest feedback, in the map's frame", () => {
    const place = placeOf(ROBOT, feedback(), NAVIGATION, false);
    expect(place).toMatchObject({ kind: "known", event: 9 });
    const pose = place.kind === "known" ? place.pose : [];
    for (const [index, value] of [1, 2, Math.PI / 2].entries()) expect(pose[index]).toBeCloseTo(value, 9);
  });

  it.each([
    ["old feedback", feedback(), NAVIGATION, true],
    ["no feedback", null, NAVIGATION, false],
    ["no word of it", feedback(), null, false],
    ["a robot that is lost", feedback(), { ...NAVIGATION, located: false }, false],
    ["a pose that is not measured", feedback({ unknown: ["yaw"] }), NAVIGATION, false],
    ["too few joints", feedback({ joints: [1] }), NAVIGATION, false],
  ])("is not known with %s", (_, heard, navigation, isOld) => {
    expect(placeOf(ROBOT, heard, navigation, isOld).kind).toBe("unknown");
  });
});

describe("a goal", () => {
  it("has the heading that was drawn, else that of the way", () => {
    expect(goalParameters(GO, [1, 1], [1, 2], null)).toEqual({ x: 1, y: 1, yaw: Math.PI / 2 });
    expect(goalParameters(GO, [1, 1], null, [0, 0, 3])).toEqual({ x: 1, y: 1, yaw: Math.PI / 4 });
    expect(goalParameters(GO, [1, 1], null, null)).toEqual({ x: 1, y: 1 });
    const headless = { ...GO, parameters: [number("x"), number("y")] };
    expect(goalParameters(headless, [1, 1], [1, 2], null)).toEqual({ x: 1, y: 1 });
  });

  it("is refused beyond the action's bounds", () => {
    expect(beyondBounds(GO, { x: 1, y: -4 })).toBeNull();
    expect(beyondBounds(GO, { x: 1, y: -4.1 })).toContain("y is outside");
  });
});

it("shows a scan only where the scanner is on the robot's own body", () => {
  const joints = ["x", "y", "yaw"].map((joint) => ({ joint, kind: "prismatic", axis: [1, 0, 0] }) as const);
  const body = {
    name: "base",
    parent: "",
    position: [0, 0, 0],
    orientation: [1, 0, 0, 0],
    joints,
    geoms: [],
  } as const;
  const ring = {
    name: "r",
    body: "base",
    count: 1,
    angle_min: 0,
    angle_increment: 1,
    range_min: 0,
    range_max: 5,
  };
  const robot = { ...ROBOT, bodies: [body], ranges: ring };
  expect(scanOf(robot, feedback({ ranges: [1] }))).toEqual({ ring, ranges: [1] });
  expect(scanOf(robot, feedback())).toBeNull();
  expect(scanOf({ ...robot, bodies: [{ ...body, parent: "arm" }] }, feedback({ ranges: [1] }))).toBeNull();
});

it("reads a path in pairs, and says ages as people do", () => {
  expect(pathPoints([1, 2, 3, 4, 5])).toEqual([
    [1, 2],
    [3, 4],
  ]);
  expect([0.5, 12, 300, 9000].map(ageWords)).toEqual(["new", "12 s old", "5 min old", "3 h old"]);
});
