import { expect, it } from "vitest";
import type { Binding } from "../../../src/protocol/wire";
import { inputHint } from "../../../src/ui/driving/input_hint";

const binding: Binding = {
  axis: "elbow",
  pad: "right_y",
  touch: "left_x",
  invert_pad: true,
  invert_touch: false,
  key_positive: "ArrowUp",
  key_negative: "KeyK",
  scale: 1,
};

it("names the part of the device in hand that moves an axis", () => {
  expect(inputHint(binding, "pad")).toBe("R ↕");
  expect(inputHint(binding, "touch")).toBe("L ↔");
  expect(inputHint(binding, "keys")).toBe("K ↑");
});

it("is empty where that device moves nothing", () => {
  expect(inputHint(undefined, "keys")).toBe("");
  expect(inputHint({ ...binding, pad: null }, "pad")).toBe("");
  expect(inputHint({ ...binding, key_positive: "", key_negative: "" }, "keys")).toBe("");
});
