import { expect, it } from "vitest";
import { limitLabels } from "../../../src/drive/labels/limit_labels";
import type { RobotDescription, SpeedCapState } from "../../../src/protocol/wire";
import { descriptionOf, feedbackOf } from "../../messages";

const DESCRIPTION: RobotDescription = {
  ...descriptionOf([]),
  geofences: [
    { name: "room", label: "Room", kind: "keep_in", polygon: [] },
    { name: "charger", label: "Charging corner", kind: "keep_out", polygon: [] },
  ],
  position_limits: [
    {
      name: "lift",
      label: "Lift range",
      joint: "lift",
      minimum: 0,
      maximum: 1,
      axes: [],
      margin: 0,
      latency: 0,
    },
  ],
};
const CAP: SpeedCapState = {
  type: "speed_cap",
  mode: "on",
  holds: true,
  share: 0.4,
  delay_ms: 500,
  why: "delay",
};

it("nothing is said while nothing limits", () => {
  expect(limitLabels(null, null, null, 1)).toEqual([]);
  expect(limitLabels(feedbackOf(1), DESCRIPTION, CAP, 1)).toEqual([]);
});

it("faults come before limits, limits before the speed", () => {
  const feedback = feedbackOf(1, { faults: ["motor hot"], limits: ["room", "charger", "lift", "new"] });
  expect(limitLabels(feedback, DESCRIPTION, CAP, 0.4)).toEqual([
    { tone: "fault", text: "motor hot" },
    { tone: "limit", text: "Stay inside: Room" },
    { tone: "limit", text: "Keep out: Charging corner" },
    { tone: "limit", text: "End of range: Lift range" },
    { tone: "limit", text: "End of range: new" },
    { tone: "cap", text: "Speed 40 % · 500 ms delay" },
  ]);
});

it("a delay that is not known is called so", () => {
  expect(limitLabels(null, null, { ...CAP, delay_ms: null }, 0.2)).toEqual([
    { tone: "cap", text: "Speed 20 % · delay unknown" },
  ]);
});

it("a hand that waits for the robot to stand still is told so, after what was refused", () => {
  expect(limitLabels(null, null, null, 1, ["Refused"], true)).toEqual([
    { tone: "fault", text: "Refused" },
    { tone: "limit", text: "Waits until the robot stands still" },
  ]);
});
