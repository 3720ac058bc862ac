import { describe, expect, it } from "vitest";
import { clockLabel } from "../../src/fleet/poll_state";
import { isTrouble, TILE_KINDS, tileState } from "../../src/fleet/tile_state";
import { robotOf } from "./fleets";

const HEARD = 1_800_000_000_000;
const KNOWN = { unknownSince: null, heardAt: HEARD };

function stateOf(rest: Record<string, unknown>): ReturnType<typeof tileState> {
  return tileState(robotOf("a", rest), KNOWN);
}

describe("a robot's state in the overview", () => {
  it("is free, or driven by somebody", () => {
    expect(stateOf({})).toEqual({ kind: "free", tone: "off", words: "Free", more: "" });
    expect(stateOf({ driver: "Ann", gap: 1, tolerance: 4 })).toMatchObject({
      kind: "driven",
      words: "Driven by Ann",
    });
  });

  it("is behind when the driver's pictures are out of tolerance, on either side", () => {
    expect(stateOf({ driver: "Ann", gap: 5, tolerance: 4 })).toMatchObject({
      kind: "behind",
      words: "Driven by Ann",
      more: "Its pictures are 5 events behind",
    });
    expect(stateOf({ driver: "Ann", gap: -5, tolerance: 4 }).kind).toBe("behind");
    expect(stateOf({ driver: "Ann", gap: 4, tolerance: 4 }).kind).toBe("driven");
    expect(stateOf({ driver: "Ann", gap: 9 }).kind).toBe("driven");
  });

  it("is stopped by somebody, whoever drives", () => {
    const stopped = { stopped: true, stop_by: "Cy", stop_reason: "a door", driver: "Ann" };
    expect(stateOf(stopped)).toEqual({
      kind: "stopped",
      tone: "bad",
      words: "Stopped by Cy",
      more: "a door",
    });
    expect(stateOf({ stopped: true }).words).toBe("Stopped");
  });

  it("is silent when its feedback is old or never came", () => {
    expect(stateOf({ feedback_age_ms: 4200, driver: "Ann" })).toMatchObject({
      kind: "silent",
      words: "Silent for 4 s",
    });
    expect(stateOf({ feedback_age_ms: null }).words).toBe("Silent: no feedback yet");
  });

  it("is unreachable since the time its link went down, and says that it was stopped", () => {
    const since = clockLabel(HEARD - 61_000);
    const down = { link: "down", link_age_ms: 61_000, detail: "connection refused" };
    expect(stateOf(down)).toEqual({
      kind: "unreachable",
      tone: "bad",
      words: `Unreachable since ${since}`,
      more: "connection refused",
    });
    expect(stateOf({ ...down, stopped: true, stop_by: "Cy" }).more).toBe(
      "Stopped by Cy when it was last heard",
    );
    expect(stateOf({ link: "down", link_age_ms: null }).words).toBe("Not reached yet");
  });

  it("is unknown while the console that has it is silent", () => {
    expect(stateOf({ link: "unknown", link_age_ms: null }).words).toBe("Unknown: its console is silent");
    expect(stateOf({ link: "unknown", link_age_ms: 1000 }).words).toBe(
      `Unknown since ${clockLabel(HEARD - 1000)}`,
    );
  });

  it("is unknown while this page's own console is lost, whatever it was before", () => {
    const lost = { unknownSince: HEARD, heardAt: HEARD };
    for (const rest of [
      {},
      { stopped: true },
      { link: "down" },
      { driver: "Ann" },
      { trouble: "claimed twice" },
    ])
      expect(tileState(robotOf("a", rest), lost)).toMatchObject({
        kind: "unknown",
        words: `Unknown since ${clockLabel(HEARD)}`,
      });
    expect(tileState(robotOf("a", { stopped: true, stop_by: "Cy" }), lost).more).toBe(
      "Before: Stopped by Cy",
    );
  });

  it("tells first what is wrong with its place in the fleet", () => {
    expect(stateOf({ trouble: "claimed twice", stopped: true })).toMatchObject({
      kind: "trouble",
      words: "claimed twice",
    });
  });

  it("names the robot's faults", () => {
    expect(stateOf({ faults: ["over-temperature", "fan"] }).more).toBe("over-temperature, fan");
  });

  it("counts all but driven and free as trouble", () => {
    expect(TILE_KINDS.filter((kind) => !isTrouble(kind))).toEqual(["driven", "free"]);
  });
});
