import { describe, expect, it } from "vitest";
import { lengthLabel, quantity, roundLength, scaleFor } from "../../src/util/units";

describe("units", () => {
  it.each([
    ["m/s", 0.6, 0.25, "0.25 m/s"],
    ["m/s", 60e-6, 12.5e-6, "12.5 µm/s"],
    ["m/s", 0.005, 0.00123, "1.23 mm/s"],
    ["m", 145e-6, -3.2e-6, "-3.2 µm"],
    ["m", 80e-9, 32e-9, "32.0 nm"],
    ["N", 400e-6, 17.25e-6, "17.3 µN"],
    ["N", 150, 3.21, "3.2 N"],
    ["N m", 0.002, 0.0015, "1.50 mN m"],
    ["rad/s", 1.2, -0.5, "-0.50 rad/s"],
    ["rad/s", 0.004, 0.0031, "0.0031 rad/s"],
    ["%/s", 50, 12, "12.0 %/s"],
    ["min", 0.001, 0.001, "0.0010 min"],
  ])("writes %s of up to %f: %f is %s", (unit, magnitude, value, words) => {
    expect(quantity(value, scaleFor(unit, magnitude))).toBe(words);
  });

  it("never shows a negative nothing", () => {
    expect(quantity(-1e-9, scaleFor("m/s", 60e-6))).toBe("0.0 µm/s");
    expect(quantity(-0.001, scaleFor("rad/s", 1))).toBe("0.00 rad/s");
  });

  it.each([0, NaN, Infinity])("leaves the unit alone when the limits say nothing: %f", (magnitude) => {
    expect(scaleFor("m/s", magnitude)).toEqual({ unit: "m/s", factor: 1, digits: 2 });
  });

  it("has a prefix for what is smaller than all prefixes too", () => {
    expect(scaleFor("m", 1e-15).unit).toBe("nm");
  });

  it.each([
    [80e-6, 50e-6, "50 µm"],
    [45e-6, 20e-6, "20 µm"],
    [1.9, 1, "1 m"],
    [0.0999, 0.05, "50 mm"],
    [0.0199, 0.01, "10 mm"],
  ])("the bar for at most %f m is %f m long: %s", (most, length, words) => {
    expect(roundLength(most)).toBeCloseTo(length, 9);
    expect(lengthLabel(roundLength(most))).toBe(words);
  });

  it("has no bar for nothing", () => {
    expect(roundLength(0)).toBe(0);
    expect(roundLength(NaN)).toBe(0);
  });
});
