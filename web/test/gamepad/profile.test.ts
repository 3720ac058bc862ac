import { describe, expect, it } from "vitest";
import { choosePad } from "../../src/gamepad/selection";
import { isSameSource, STANDARD_LAYOUT } from "../../src/gamepad/layout";
import { actionName, sourceName } from "../../src/gamepad/source_names";
import { padName, setupOf, withProfile } from "../../src/gamepad/profile";
import { DEFAULT_SHAPING } from "../../src/gamepad/stick_shape";
import { ODD_LAYOUT, padOf } from "./pads";

const AXES = [0, 0, -1, 0, 0, -1, 3];
const slow = { ...DEFAULT_SHAPING, normal: 0.5 };

describe("a pad's setup", () => {
  it("is the standard mapping where the browser knows it, and nothing where it does not", () => {
    expect(setupOf(padOf(AXES), [])).toEqual({
      layout: STANDARD_LAYOUT,
      shaping: DEFAULT_SHAPING,
      calibrated: false,
    });
    expect(setupOf(padOf(AXES, [], ""), []).layout).toBeNull();
  });

  it("is its own profile's, of the same make only", () => {
    const profiles = [{ id: "odd", layout: ODD_LAYOUT, shaping: slow }];
    const own = setupOf(padOf(AXES, [], "", "odd"), profiles);
    expect(own).toEqual({ layout: ODD_LAYOUT, shaping: slow, calibrated: true });
    expect(setupOf(padOf(AXES, [], "", "other"), profiles).layout).toBeNull();
  });

  it("is without a layout that names parts which this pad does not have", () => {
    const setup = setupOf(padOf([0, 0], [], "", "odd"), [{ id: "odd", layout: ODD_LAYOUT, shaping: slow }]);
    expect(setup).toEqual({ layout: null, shaping: slow, calibrated: false });
  });

  it("keeps the settings of a standard pad", () => {
    expect(setupOf(padOf(AXES), [{ id: "pad", layout: null, shaping: slow }])).toEqual({
      layout: STANDARD_LAYOUT,
      shaping: slow,
      calibrated: false,
    });
  });
});

describe("profiles", () => {
  const first = { id: "a", layout: null, shaping: slow };
  const second = { id: "b", layout: null, shaping: slow };

  it("are replaced by a newer one of the same pad", () => {
    const newer = { ...first, shaping: DEFAULT_SHAPING };
    expect(withProfile([first, second], newer)).toEqual([second, newer]);
  });

  it("are named without what the browser adds", () => {
    expect(padName("DualShock 4 (STANDARD GAMEPAD Vendor: 054c)")).toBe("DualShock 4");
    expect(padName("(Vendor: 054c)")).toBe("Gamepad");
  });
});

describe("of several pads", () => {
  const a = { index: 0, id: "a", ready: true };
  const b = { index: 1, id: "b", ready: true };
  const odd = { index: 2, id: "odd", ready: false };

  it("none is chosen when there is none", () => expect(choosePad([], a, "a")).toBeNull());

  it("the one in use stays, whatever else comes", () => {
    expect(choosePad([a, b], { index: 1, id: "b" }, "a")).toBe(1);
  });

  it("another in its place is not it", () => {
    expect(choosePad([a, b], { index: 1, id: "z" }, null)).toBe(0);
  });

  it("the preferred one comes first, and one that can drive before one that cannot", () => {
    expect(choosePad([a, b], null, "b")).toBe(1);
    expect(choosePad([odd, a], null, "odd")).toBe(0);
    expect(choosePad([odd], null, null)).toBe(2);
  });

  it("one that cannot drive makes room for one that can", () => {
    expect(choosePad([odd, a], { index: 2, id: "odd" }, null)).toBe(0);
    expect(choosePad([odd, { ...odd, index: 3 }], { index: 3, id: "odd" }, null)).toBe(3);
  });
});

describe("a part of a pad", () => {
  it("is called what is printed on it", () => {
    expect(actionName(STANDARD_LAYOUT, "deadman", true)).toBe("RB");
    expect(actionName(ODD_LAYOUT, "deadman", false)).toBe("button 4");
    expect(actionName(ODD_LAYOUT, "slow", false)).toBeNull();
    expect(sourceName({ kind: "button", index: 40 }, true)).toBe("button 40");
    expect(sourceName({ kind: "axis", index: 2, rest: -1, full: 1 }, true)).toBe("axis 2");
    expect(sourceName({ kind: "hat", index: 9, value: 1 }, false)).toBe("hat on axis 9");
  });

  it("is the same as itself only", () => {
    const axis = { kind: "axis", index: 2, rest: 0, full: 1 } as const;
    const hat = { kind: "hat", index: 2, value: -1 } as const;
    expect(isSameSource(axis, { ...axis, full: 0.9 })).toBe(true);
    expect(isSameSource(axis, { ...axis, full: -1 })).toBe(false);
    expect(isSameSource(hat, { ...hat, value: 0.5 })).toBe(false);
    expect(isSameSource(hat, hat)).toBe(true);
    expect(isSameSource(hat, axis)).toBe(false);
    expect(isSameSource({ kind: "button", index: 2 }, { kind: "button", index: 2 })).toBe(true);
  });
});
