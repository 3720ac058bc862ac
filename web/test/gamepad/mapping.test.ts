import { describe, expect, it } from "vitest";
import { STANDARD_LAYOUT } from "../../src/gamepad/layout";
import { deflection, lacks, readPad, type PadReading, type PadSnapshot } from "../../src/gamepad/mapping";
import { isStandard } from "../../src/gamepad/standard_mapping";
import { DEFAULT_SHAPING } from "../../src/gamepad/stick_shape";
import { ODD_LAYOUT, padOf } from "./pads";

const readStandard = (pad: PadSnapshot): PadReading =>
  readPad(pad, STANDARD_LAYOUT, DEFAULT_SHAPING, new Set());

describe("a pad of the standard mapping", () => {
  it("has four stick axes, left and up negative", () => {
    const { inputs } = readStandard(padOf([-1, -1, 1, 1]));
    expect([inputs.left_x, inputs.left_y, inputs.right_x, inputs.right_y]).toEqual([-1, -1, 1, 1]);
  });

  it("has a cross of buttons 12 to 15", () => {
    expect(readStandard(padOf([], [12, 14])).inputs).toMatchObject({ dpad_x: -1, dpad_y: -1 });
    expect(readStandard(padOf([], [13, 15])).inputs).toMatchObject({ dpad_x: 1, dpad_y: 1 });
  });

  it("has triggers, right minus left", () => {
    expect(readStandard(padOf([], [7])).inputs.triggers).toBe(1);
    expect(readStandard(padOf([], [6])).inputs.triggers).toBe(-1);
    expect(readStandard(padOf([], [6, 7])).inputs.triggers).toBe(0);
  });

  it("has buttons that do things, STOP two of them", () => {
    expect([...readStandard(padOf([], [5, 4, 3])).pressed].sort()).toEqual(["deadman", "layer", "slow"]);
    expect(readStandard(padOf([], [1])).pressed).toEqual(new Set(["stop"]));
    expect(readStandard(padOf([], [8])).pressed).toEqual(new Set(["stop"]));
  });

  it("takes a pressed button without a value as fully pressed", () => {
    const pad = padOf([]);
    const buttons = pad.buttons.map((button, index) => (index === 15 ? { pressed: true, value: 0 } : button));
    expect(readStandard({ ...pad, buttons }).inputs.dpad_x).toBe(1);
  });

  it("may lack parts", () => {
    const { inputs, pressed } = readStandard({ id: "", mapping: "standard", axes: [], buttons: [] });
    expect(Object.values(inputs).every((value) => value === 0)).toBe(true);
    expect(pressed.size).toBe(0);
  });

  it("is told from a pad that the browser does not know", () => {
    expect(isStandard(padOf([]))).toBe(true);
    expect(isStandard(padOf([], [], ""))).toBe(false);
  });
});

describe("a calibrated pad", () => {
  const rest = [0, 0, -1, 0, 0, -1, 23 / 7];
  const seen = new Set<string>();
  const read = (axes: number[], pressed: number[] = []): PadReading =>
    readPad(padOf(axes, pressed, ""), ODD_LAYOUT, DEFAULT_SHAPING, seen);

  it("reads nothing from triggers before they were seen at rest, though they read 0 until they are touched", () => {
    const { inputs } = readPad(padOf([0, 0, 0, 0, 0, 0], [], ""), ODD_LAYOUT, DEFAULT_SHAPING, new Set());
    expect(inputs.triggers).toBe(0);
    expect(read([0, 0, 0, 0, 0, 1, 23 / 7]).inputs.triggers).toBe(0);
    expect(read(rest).inputs.triggers).toBe(0);
    expect(read([0, 0, -1, 0, 0, 1, 23 / 7]).inputs.triggers).toBe(1);
    expect(read([0, 0, 1, 0, 0, -1, 23 / 7]).inputs.triggers).toBe(-1);
  });

  it("turns an axis round that counts the other way", () => {
    expect(read([0, 1, -1, 0, 0, -1]).inputs.left_y).toBe(-1);
  });

  it.each([
    [-1, 0, -1],
    [-5 / 7, 1, -1],
    [-3 / 7, 1, 0],
    [-1 / 7, 1, 1],
    [1 / 7, 0, 1],
    [3 / 7, -1, 1],
    [5 / 7, -1, 0],
    [1, -1, -1],
    [23 / 7, 0, 0],
    [9 / 7, 0, 0],
  ])("reads %f on its hat as %i, %i", (value, x, y) => {
    const { dpad_x, dpad_y } = read([0, 0, -1, 0, 0, -1, value]).inputs;
    expect([dpad_x, dpad_y]).toEqual([x, y]);
  });

  it("has buttons of its own", () => expect(read(rest, [4]).pressed).toEqual(new Set(["deadman"])));

  it("is at rest where a value is not a number", () => {
    const { inputs, pressed } = read([NaN, NaN, NaN, NaN, NaN, NaN, NaN]);
    expect(Object.values(inputs).every((value) => value === 0)).toBe(true);
    expect(pressed.size).toBe(0);
  });

  it("is told from a pad that lacks what its layout names", () => {
    expect(lacks(padOf(rest), ODD_LAYOUT)).toBe(false);
    expect(lacks(padOf(rest.slice(0, 6)), ODD_LAYOUT)).toBe(true);
    expect(lacks({ ...padOf(rest), buttons: [] }, ODD_LAYOUT)).toBe(true);
  });
});

describe("a stick's travel", () => {
  const source = { index: 0, negative: -0.8, rest: 0.1, positive: 0.9 };

  it.each([
    [0.1, 0],
    [0.9, 1],
    [1, 1],
    [-0.8, -1],
    [0.5, 0.5],
    [-0.35, -0.5],
  ])("maps %f to %f", (raw, value) => expect(deflection(padOf([raw]), source)).toBeCloseTo(value));

  it("is 0 where the pad has no such axis", () => expect(deflection(padOf([]), source)).toBe(0));
});
