import { describe, expect, it } from "vitest";
import { boundedShaping, speedShare } from "../../src/gamepad/shaping";
import { DEFAULT_SHAPING, shapeStick } from "../../src/gamepad/stick_shape";

const PLAIN = { ...DEFAULT_SHAPING, deadzone: 0, expo: 0 };

describe("a stick", () => {
  it("does nothing within its play", () => {
    expect([0, 0.12, -0.12, 0.05].map((value) => shapeStick(value))).toEqual([0, 0, 0, 0]);
  });

  it("reaches the full value at its end, and not more", () => {
    expect([1, -1, 1.02].map((value) => shapeStick(value))).toEqual([1, -1, 1]);
    expect(shapeStick(1, { ...DEFAULT_SHAPING, deadzone: 0.5, expo: 1 })).toBe(1);
  });

  it("starts from nothing and is gentle near the middle", () => {
    expect(shapeStick(0.13)).toBeLessThan(0.02);
    expect(shapeStick(0.56)).toBeLessThan(0.5);
    expect(shapeStick(0.4)).toBeGreaterThan(shapeStick(0.3));
  });

  it("is at rest when its value is not a number", () => expect(shapeStick(NaN)).toBe(0));

  it("is a straight line without deadzone and expo, and a cube with all of it", () => {
    expect(shapeStick(0.5, PLAIN)).toBe(0.5);
    expect(shapeStick(-0.5, { ...PLAIN, expo: 1 })).toBe(-0.125);
  });
});

describe("the speed share", () => {
  const shaping = { ...DEFAULT_SHAPING, slow: 0.2, normal: 0.6, turbo: 0.9 };

  it("is normal, slow or turbo", () => {
    expect(speedShare(shaping, false, false)).toBe(0.6);
    expect(speedShare(shaping, true, false)).toBe(0.2);
    expect(speedShare(shaping, false, true)).toBe(0.9);
  });

  it("is slow when both are held", () => expect(speedShare(shaping, true, true)).toBe(0.2));

  it("never passes the axes' limits, and turbo never slows down", () => {
    expect(speedShare({ ...shaping, turbo: 3 }, false, true)).toBe(1);
    expect(speedShare({ ...shaping, turbo: 0.1 }, false, true)).toBe(0.6);
  });
});

describe("settings from elsewhere", () => {
  it("are kept within bounds", () => {
    expect(boundedShaping({ deadzone: 0.9, expo: -1, slow: 0, normal: 7, turbo: 0.5 })).toEqual({
      deadzone: 0.5,
      expo: 0,
      slow: 0.02,
      normal: 1,
      turbo: 0.5,
    });
  });

  it("take their defaults where they are no numbers", () => {
    expect(boundedShaping({ deadzone: "0.2", expo: NaN, normal: null })).toEqual(DEFAULT_SHAPING);
  });
});
