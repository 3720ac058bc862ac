import { describe, expect, it } from "vitest";
import { axisValues, neutralValues, type HeldInputs } from "../../src/drive/axis_mapping";
import type { PadInputs } from "../../src/gamepad/mapping";
import type { Binding, ControlLayer } from "../../src/protocol/wire";
import { axisOf } from "../messages";

const NO_PAD: PadInputs = { left_x: 0, left_y: 0, right_x: 0, right_y: 0, dpad_x: 0, dpad_y: 0, triggers: 0 };
const NO_TOUCH = { left_x: 0, left_y: 0, right_x: 0, right_y: 0 };

function bindingOf(axis: string, rest: Partial<Binding>): Binding {
  return {
    axis,
    pad: null,
    touch: null,
    invert_pad: false,
    invert_touch: false,
    key_positive: "",
    key_negative: "",
    scale: 1,
    ...rest,
  };
}

function layerOf(...bindings: Binding[]): ControlLayer {
  return { name: "layer", label: "Layer", bindings };
}

function held(rest: Partial<HeldInputs>): HeldInputs {
  return { pad: null, keys: new Set(), touch: null, ...rest };
}

const axes = [axisOf("vx"), axisOf("vy", { rest: 0.5 })];
const forward = layerOf(
  bindingOf("vx", {
    pad: "left_y",
    invert_pad: true,
    touch: "left_y",
    key_positive: "KeyW",
    key_negative: "KeyS",
  }),
);

describe("axis values", () => {
  it("rest without a layer and without input", () => {
    expect(axisValues(axes, undefined, held({}), 1)).toEqual([0, 0.5]);
    expect(axisValues(axes, forward, held({}), 1)).toEqual(neutralValues(axes));
  });

  it("reach the limits either way", () => {
    const push = (left_y: number): (number | null)[] =>
      axisValues(axes, forward, held({ pad: { ...NO_PAD, left_y } }), 1);
    expect(push(-1)[0]).toBe(2);
    expect(push(1)[0]).toBe(-1);
    expect(push(-0.5)[0]).toBe(1);
  });

  it("follow keys and touch as well", () => {
    expect(axisValues(axes, forward, held({ keys: new Set(["KeyW"]) }), 1)[0]).toBe(2);
    expect(axisValues(axes, forward, held({ keys: new Set(["KeyS"]) }), 1)[0]).toBe(-1);
    expect(axisValues(axes, forward, held({ keys: new Set(["KeyW", "KeyS"]) }), 1)[0]).toBe(0);
    expect(axisValues(axes, forward, held({ touch: { ...NO_TOUCH, left_y: 1 } }), 1)[0]).toBe(2);
  });

  it("may be turned around for touch", () => {
    const turned = layerOf(bindingOf("vx", { touch: "right_x", invert_touch: true }));
    expect(axisValues(axes, turned, held({ touch: { ...NO_TOUCH, right_x: 1 } }), 1)[0]).toBe(-1);
  });

  it("never pass the limits when several inputs add up", () => {
    const all = held({ pad: { ...NO_PAD, left_y: -1 }, keys: new Set(["KeyW"]) });
    expect(axisValues(axes, forward, all, 1)[0]).toBe(2);
  });

  it("are slowed by the binding and by the operator", () => {
    const half = layerOf(bindingOf("vx", { key_positive: "KeyW", scale: 0.5 }));
    expect(axisValues(axes, half, held({ keys: new Set(["KeyW"]) }), 1)[0]).toBe(1);
    expect(axisValues(axes, half, held({ keys: new Set(["KeyW"]) }), 0.3)[0]).toBeCloseTo(0.3);
  });

  it("rest when an input is not a number", () => {
    expect(axisValues(axes, forward, held({ pad: { ...NO_PAD, left_y: NaN } }), 1)[0]).toBe(0);
  });

  it("an empty key name is never held", () => {
    const oneWay = layerOf(bindingOf("vx", { key_positive: "KeyW" }));
    expect(axisValues(axes, oneWay, held({ keys: new Set([""]) }), 1)[0]).toBe(0);
  });
});
