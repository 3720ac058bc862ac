import { describe, expect, it } from "vitest";
import {
  NO_PROFILES,
  MAX_PROFILES,
  mergeProfiles,
  readProfiles,
  writeProfiles,
  type PadProfiles,
} from "../../src/gamepad/profile_file";
import { DEFAULT_SHAPING } from "../../src/gamepad/stick_shape";
import { ODD_LAYOUT } from "./pads";

const BOOK: PadProfiles = {
  profiles: [
    { id: "odd", layout: ODD_LAYOUT, shaping: { ...DEFAULT_SHAPING, turbo: 0.8 } },
    { id: "known", layout: null, shaping: DEFAULT_SHAPING },
  ],
  preferred: "odd",
};

/** The stored text with one thing in it changed, or left out. */
function damaged(path: string, value: unknown): string {
  const book: unknown = JSON.parse(writeProfiles(BOOK));
  const keys = path.split(".");
  const last = keys.pop() ?? "";
  let at = book as Record<string, unknown>;
  for (const key of keys) at = at[key] as Record<string, unknown>;
  at[last] = value;
  return JSON.stringify(book);
}

describe("the profiles of pads", () => {
  it("are read as they were written", () =>
    expect(readProfiles(writeProfiles(BOOK))).toEqual({ kind: "profiles", book: BOOK }));

  it("are at most so many, the newest", () => {
    const profiles = Array.from({ length: MAX_PROFILES + 3 }, (_, at) => ({
      id: `${at}`,
      layout: null,
      shaping: DEFAULT_SHAPING,
    }));
    const read = readProfiles(writeProfiles({ profiles, preferred: null }));
    expect(read.kind === "profiles" && read.book.profiles.map(({ id }) => id).slice(0, 1)).toEqual(["3"]);
  });

  it.each<[string, string, unknown]>([
    ["no profiles", "profiles", undefined],
    ["another format", "format", "other"],
    ["another version", "version", 2],
    ["too many profiles", "profiles", Array(MAX_PROFILES + 1).fill({ id: "a", layout: null, shaping: {} })],
    ["a profile without a pad", "profiles.0.id", undefined],
    ["a profile that is no object", "profiles.0", 5],
    ["a layout that is no object", "profiles.0.layout", []],
    ["no sticks", "profiles.0.layout.sticks", undefined],
    ["a stick without travel", "profiles.0.layout.sticks.left_x.positive", -1],
    ["a stick that is a word", "profiles.0.layout.sticks.left_x", "axis 0"],
    ["a stick that is far away", "profiles.0.layout.sticks.left_x.index", 1e9],
    ["a trigger that is endless", "profiles.0.layout.triggers.left_trigger.full", 1e300],
    ["a trigger without travel", "profiles.0.layout.triggers.left_trigger.full", -1],
    ["an unknown kind of source", "profiles.0.layout.cross.cross_up.kind", "key"],
    ["actions that are no lists", "profiles.0.layout.actions.stop", {}],
    ["no hold to move", "profiles.0.layout.actions.deadman", []],
    ["no STOP", "profiles.0.layout.actions.stop", []],
    ["one bad source of several", "profiles.0.layout.actions.stop", [{ kind: "button", index: -1 }]],
  ])("with %s are left out", (_, path, value) => expect(readProfiles(damaged(path, value)).kind).toBe("bad"));

  it.each(["", "null", "[]", "{", "5", `"${"x".repeat(300_000)}"`])(
    "are not read from something else",
    (text) => {
      expect(readProfiles(text).kind).toBe("bad");
    },
  );

  it("take settings that are out of bounds within them", () => {
    const read = readProfiles(damaged("profiles.0.shaping", { normal: 99, deadzone: "much" }));
    expect(read.kind === "profiles" && read.book.profiles[0]?.shaping).toEqual(DEFAULT_SHAPING);
  });

  it("of a file win over those of the same pads", () => {
    const mine = { id: "known", layout: null, shaping: { ...DEFAULT_SHAPING, expo: 0 } };
    const kept = { id: "kept", layout: null, shaping: DEFAULT_SHAPING };
    const merged = mergeProfiles({ profiles: [mine, kept], preferred: null }, BOOK);
    expect(merged).toEqual({ profiles: [kept, ...BOOK.profiles], preferred: "odd" });
    expect(mergeProfiles({ profiles: [], preferred: "mine" }, NO_PROFILES).preferred).toBe("mine");
  });
});
