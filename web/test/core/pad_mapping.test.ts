import { describe, expect, it } from "vitest";
import { isPressed, isStandard, readPad, shapeStick, type PadSnapshot } from "../../src/core/pad_mapping";

function padOf(axes: number[], pressed: number[] = [], mapping = "standard"): PadSnapshot {
  const buttons = Array.from({ length: 17 }, (_, index) => {
    const down = pressed.includes(index);
    return { pressed: down, value: down ? 1 : 0 };
  });
  return { mapping, axes, buttons };
}

describe("a stick", () => {
  it("does nothing within its play", () => {
    expect([0, 0.12, -0.12, 0.05].map(shapeStick)).toEqual([0, 0, 0, 0]);
  });

  it("reaches the full value at its end, and not more", () => {
    expect([1, -1, 1.02].map(shapeStick)).toEqual([1, -1, 1]);
  });

  it("starts from nothing and is gentle near the middle", () => {
    expect(shapeStick(0.13)).toBeLessThan(0.02);
    expect(shapeStick(0.56)).toBeLessThan(0.5);
    expect(shapeStick(0.4)).toBeGreaterThan(shapeStick(0.3));
  });

  it("is at rest when its value is not a number", () => expect(shapeStick(NaN)).toBe(0));
});

describe("a pad of the standard mapping", () => {
  it("has four stick axes, left and up negative", () => {
    const inputs = readPad(padOf([-1, -1, 1, 1]));
    expect([inputs.left_x, inputs.left_y, inputs.right_x, inputs.right_y]).toEqual([-1, -1, 1, 1]);
  });

  it("has a cross of buttons 12 to 15", () => {
    expect(readPad(padOf([], [12, 14]))).toMatchObject({ dpad_x: -1, dpad_y: -1 });
    expect(readPad(padOf([], [13, 15]))).toMatchObject({ dpad_x: 1, dpad_y: 1 });
  });

  it("has triggers, right minus left", () => {
    expect(readPad(padOf([], [7])).triggers).toBe(1);
    expect(readPad(padOf([], [6])).triggers).toBe(-1);
    expect(readPad(padOf([], [6, 7])).triggers).toBe(0);
  });

  it("takes a pressed button without a value as fully pressed", () => {
    const pad = padOf([]);
    const buttons = pad.buttons.map((button, index) => (index === 15 ? { pressed: true, value: 0 } : button));
    expect(readPad({ ...pad, buttons }).dpad_x).toBe(1);
  });

  it("may lack parts", () => {
    const inputs = readPad({ mapping: "standard", axes: [], buttons: [] });
    expect(Object.values(inputs).every((value) => value === 0)).toBe(true);
    expect(isPressed({ mapping: "standard", axes: [], buttons: [] }, 5)).toBe(false);
  });

  it("is told from a pad that the browser does not know", () => {
    expect(isStandard(padOf([]))).toBe(true);
    expect(isStandard(padOf([], [], ""))).toBe(false);
  });
});
