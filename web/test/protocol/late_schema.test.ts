import { describe, expect, it } from "vitest";
import { lateMisfit } from "../../src/protocol/late_schema";

const IDLE = {
  ...{ type: "episode", phase: "idle", episode: "", number: 0, task: "", by: "", seconds_left: 0, since: 0 },
  ...{
    first_event: 0,
    kept: 0,
    discarded: 0,
    cut: 0,
    last: "",
    lost: "",
    last_episode: "",
    reads_recordings: false,
    reset_action: "",
    problems: [],
  },
};
const ANSWER = { type: "episode_answer", id: "x", reason: "empty", detail: "", episode: "" };

describe("the schema of later messages", () => {
  it("fits messages about episodes", () => {
    expect(lateMisfit("episode", IDLE)).toBeNull();
    expect(lateMisfit("episode_answer", ANSWER)).toBeNull();
  });

  it.each([
    ["nothing", null],
    ["a list", []],
    ["missing fields", { type: "episode" }],
    ["a field of the wrong type", { ...IDLE, kept: "3" }],
    ["another message", { type: "welcome" }],
    ["a word outside its list", { ...IDLE, phase: "x" }],
  ])("says what is wrong with %s", (_name, message) => {
    expect(lateMisfit("episode", message)).not.toBeNull();
  });

  it.each(["navigation", "traces", "shadow_verdict", "episode_answer", "surprise"])(
    "knows %s by its type",
    (type) => {
      const known = type !== "surprise";
      expect(lateMisfit(type, { type })?.includes("unknown schema")).toBe(!known);
    },
  );
});
