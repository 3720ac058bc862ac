import { describe, expect, it } from "vitest";
import { ResetHold } from "../../src/headset/reset_hold";

const ON = (): boolean => true;
const OFF = (): boolean => false;

describe("the reset in a headset", () => {
  it("is held for a second, and then once", () => {
    const hold = new ResetHold();
    hold.press("left", 100);
    expect(hold.step(ON, 1099)).toBeNull();
    expect(hold.step(ON, 1100)).toBe(100);
    expect(hold.step(ON, 3000)).toBeNull();
  });

  it("begins anew when the hand has left it", () => {
    const hold = new ResetHold();
    hold.press("left", 0);
    expect(hold.step(OFF, 500)).toBeNull();
    expect(hold.step(ON, 2000)).toBeNull();
  });

  it("asks for the hand that pressed it", () => {
    const hold = new ResetHold();
    hold.press("right", 0);
    expect(hold.step((side) => side === "right", 1000)).toBe(0);
  });
});
