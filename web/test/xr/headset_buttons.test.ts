import { describe, expect, it } from "vitest";
import { pressable } from "../../src/xr/headset_buttons";

describe("the buttons in a headset", () => {
  it("are all for a hand that does not drive", () => {
    for (const name of ["leave", "recentre", "reset", "stop"] as const)
      expect(pressable(name, false)).toBe(name);
    expect(pressable(null, false)).toBeNull();
  });

  it("are STOP alone for a hand that drives", () => {
    for (const name of ["leave", "recentre", "reset"] as const) expect(pressable(name, true)).toBeNull();
    expect(pressable("stop", true)).toBe("stop");
    expect(pressable(null, true)).toBeNull();
  });
});
