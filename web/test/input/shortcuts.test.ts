import { expect, it } from "vitest";
import { keyName, pageAction } from "../../src/input/shortcuts";
import { descriptionOf } from "../messages";

const description = {
  ...descriptionOf([]),
  layers: [
    {
      name: "arm",
      label: "Arm",
      bindings: [
        {
          axis: "x",
          pad: null,
          touch: null,
          invert_pad: false,
          invert_touch: false,
          key_positive: "KeyC",
          key_negative: "ArrowDown",
          scale: 1,
        },
      ],
    },
  ],
};

it("a key works the page, unless it drives the robot and the page is armed", () => {
  expect(pageAction("KeyC", false, description)).toBe("charts");
  expect(pageAction("KeyC", true, description)).toBeNull();
  expect(pageAction("KeyX", true, description)).toBe("save");
  expect(pageAction("KeyF", true, null)).toBe("freeze");
  expect(pageAction("KeyP", true, description)).toBe("frames");
  expect(pageAction("KeyW", false, null)).toBeNull();
});

it("keys have the names that are printed on them", () => {
  expect(["KeyW", "ArrowUp", "Digit1", "ShiftLeft", "Space"].map(keyName)).toEqual([
    "W",
    "↑",
    "1",
    "Shift Left",
    "Space",
  ]);
});
