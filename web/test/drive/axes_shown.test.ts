import { expect, it } from "vitest";
import { axesShown } from "../../src/drive/axes_shown";
import type { ControlLayer } from "../../src/protocol/wire";
import { axisOf, descriptionOf, goalAxisOf } from "../messages";

const binding = {
  ...{ pad: null, touch: null, invert_pad: false, invert_touch: false },
  ...{ key_positive: "", key_negative: "", scale: 1 },
};
const layerOf = (name: string, ...axes: string[]): ControlLayer => ({
  name,
  label: name,
  bindings: axes.map((axis) => ({ ...binding, axis })),
});
const robot = descriptionOf([axisOf("base"), axisOf("lamp"), goalAxisOf("elbow"), goalAxisOf("wrist")]);

it("of a layer its own axes are shown, and goal axes that no layer binds, whose slider is the only way", () => {
  const layered = { ...robot, layers: [layerOf("drive", "base"), layerOf("arm", "elbow")] };
  expect([...axesShown(layered, 0)]).toEqual(["base", "wrist"]);
  expect([...axesShown(layered, 1)]).toEqual(["elbow", "wrist"]);
});

it("without a layer all axes are shown", () => {
  expect([...axesShown(robot, 0)]).toEqual(["base", "lamp", "elbow", "wrist"]);
  expect([...axesShown({ ...robot, layers: [layerOf("empty")] }, 0)]).toHaveLength(4);
});
