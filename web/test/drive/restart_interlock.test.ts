import { describe, expect, it } from "vitest";
import { applyMessage, createConsoleState, type ConsoleState } from "../../src/session/console_state";
import { restartInterlock, snapshotOf } from "../../src/drive/restart_interlock";
import type { ServerMessage } from "../../src/protocol/wire";
import { feedbackOf, refusalOf, robotOf, stopOf, welcomeOf } from "../messages";

/** A page that hears of a robot which nothing keeps from moving. */
function driven(): ConsoleState {
  const state = createConsoleState();
  applyMessage(state, welcomeOf("operator"), 0);
  applyMessage(state, robotOf("up"), 0);
  applyMessage(state, feedbackOf(5, { stop: stopOf({ number: 3 }) }), 0);
  return state;
}

function after(message: ServerMessage, awaitsNeutral = false): string | null {
  const state = driven();
  const before = snapshotOf(state);
  applyMessage(state, message, 0);
  return restartInterlock(before, state, message, awaitsNeutral);
}

describe("whoever drives", () => {
  it("goes on after feedback, pongs and refusals that another try cures", () => {
    expect(after(feedbackOf(6, { stop: stopOf({ number: 3 }) }))).toBeNull();
    expect(after({ type: "pong", id: 1 })).toBeNull();
    for (const reason of ["late", "out_of_order", "rested", "warning", "unseen"] as const)
      expect(after(refusalOf(6, reason))).toBeNull();
  });

  it("is stopped by any message that tells of a stop, or of one that was reset already", () => {
    const stopped = stopOf({ stopped: true, number: 4 });
    const between = stopOf({ stopped: false, number: 4 });
    for (const stop of [stopped, between]) {
      expect(after({ type: "stop_state", stop, event: 5 })).toBe("stopped");
      expect(after(feedbackOf(6, { stop }))).toBe("stopped");
    }
    expect(after(refusalOf(6, "stopped"))).toBe("stopped");
  });

  it("is not troubled by a late message of an older stop", () => {
    expect(after({ type: "stop_state", stop: stopOf({ stopped: true, number: 2 }), event: 4 })).toBeNull();
  });

  it("is disarmed by a robot that asks for a neutral command, but for the one that arming sends", () => {
    const asks = feedbackOf(6, { neutral_needed: true, stop: stopOf({ number: 3 }) });
    expect(after(asks)).toBe("neutral_needed");
    expect(after(asks, true)).toBeNull();
    expect(after(refusalOf(6, "not_neutral"), true)).toBe("neutral_needed");
  });

  it("is disarmed by a lock at the robot, a link that is down, and another run of the bridge", () => {
    const locked = stopOf({ stopped: true, number: 4, locked_out: "key switch" });
    expect(after({ type: "stop_state", stop: locked, event: 5 })).toBe("locked_out");
    expect(after(refusalOf(6, "locked_out"))).toBe("locked_out");
    expect(after(robotOf("down", "silent"))).toBe("robot_down");
    expect(after({ ...robotOf("up"), epoch: "next" })).toBe("robot_down");
  });

  it("loses the robot with the seat, and not by a refusal of something else", () => {
    expect(after(refusalOf(6, "no_seat"))).toBe("seat_lost");
    expect(after({ ...refusalOf(0, "no_seat"), stop: 3 })).toBeNull();
  });
});
