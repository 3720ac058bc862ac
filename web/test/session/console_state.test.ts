import { describe, expect, it } from "vitest";
import {
  applyMessage,
  createConsoleState,
  forgetConnection,
  holdsSeat,
  isOperator,
  note,
  robotIsUp,
} from "../../src/session/console_state";
import { takeResetWords } from "../../src/stop/reset_labels";
import { RESET_WORDS } from "../../src/stop/reset_words";
import { feedbackOf, refusalOf, robotOf, seatOf, stopOf, welcomeOf } from "../messages";

describe("the console's state", () => {
  it("knows who we are and whether we may drive", () => {
    const state = createConsoleState();
    expect([isOperator(state), holdsSeat(state), robotIsUp(state)]).toEqual([false, false, false]);
    applyMessage(state, welcomeOf("operator"), 0);
    applyMessage(state, seatOf("me", "somebody"), 0);
    applyMessage(state, robotOf("up"), 0);
    expect([isOperator(state), holdsSeat(state), robotIsUp(state)]).toEqual([true, true, true]);
    applyMessage(state, seatOf("", ""), 0);
    applyMessage(state, robotOf("down", "silent"), 0);
    expect([holdsSeat(state), robotIsUp(state)]).toEqual([false, false]);
    expect(state.log.map((line) => line.level)).toContain("error");
  });

  it("keeps the newest feedback and its stop state", () => {
    const state = createConsoleState();
    const stop = stopOf({ stopped: true, by: "Ada", reason: "test" });
    applyMessage(state, feedbackOf(5, { issue: 2, stop }), 0);
    applyMessage(state, feedbackOf(4, { issue: 9 }), 0);
    applyMessage(state, feedbackOf(5, { issue: 1 }), 0);
    expect(state.feedback).toMatchObject({ event: 5, issue: 2 });
    expect(state.stop).toEqual(stop);
    applyMessage(state, feedbackOf(5, { issue: 3 }), 0);
    expect(state.stop.stopped).toBe(false);
  });

  it("takes stop states, participants and pongs", () => {
    const state = createConsoleState();
    applyMessage(state, { type: "stop_state", stop: stopOf({ stopped: true, by: "x" }), event: 3 }, 0);
    applyMessage(state, { type: "participants", participants: [] }, 0);
    applyMessage(state, { type: "pong", id: 1 }, 0);
    expect(state.stop.by).toBe("x");
  });

  it("logs an action that ended before this page came under the time of its end", () => {
    const state = createConsoleState();
    const ended = { id: "a", name: "home", state: "failed", reason: "", text: "jammed", age: 30 } as const;
    const more = { progress: 0.5, moves: true, event: 5, began: 4, by: "Ada" };
    applyMessage(state, { type: "action", ...ended, ...more }, 100_000);
    expect(state.log[0]).toMatchObject({ text: "home: failed jammed", atMs: 70_000 });
  });

  it("logs refusals and notices in words, and counts the same ones up", () => {
    const state = createConsoleState();
    applyMessage(state, refusalOf(4, "late"), 1);
    applyMessage(state, refusalOf(5, "late"), 2);
    applyMessage(state, { ...refusalOf(5, "wrong_size"), detail: "3 values are needed" }, 3);
    applyMessage(state, { type: "notice", level: "info", text: "hello" }, 4);
    expect(state.log.map(({ text, count }) => [text, count])).toEqual([
      ["hello", 1],
      ["Refused: The command does not have one value for each axis (3 values are needed)", 1],
      ["Refused: The command came too late: the feedback that it answers is too old", 2],
    ]);
  });

  it("says why a seat changed hands", () => {
    const state = createConsoleState();
    applyMessage(state, seatOf("x", "Ada"), 0);
    expect([state.log.length, state.handOver]).toEqual([0, null]);
    applyMessage(state, { ...seatOf("", ""), why: "heartbeat lost" }, 0);
    expect(state.log[0]?.text).toBe("Ada fell silent: the control seat is free");
    expect(state.handOver).toMatchObject({ toMe: false, fromMe: false });
  });

  it("takes back what an earlier connection said of the seat when the next one says who has it", () => {
    const state = createConsoleState();
    applyMessage(state, seatOf("x", "Ada"), 0);
    applyMessage(state, { ...seatOf("", ""), why: "disconnected" }, 0);
    forgetConnection(state);
    expect(state.seatNotice?.words).toBe("Ada left: the control seat is free");
    applyMessage(state, seatOf("x", "Ada"), 0);
    expect([state.seatNotice, state.seat?.name]).toEqual([null, "Ada"]);
  });

  it("keeps only the newest lines of the log", () => {
    const state = createConsoleState();
    for (let index = 0; index < 100; index++) note(state, "info", `line ${index}`, index);
    expect(state.log).toHaveLength(40);
    expect(state.log[0]?.text).toBe("line 99");
  });

  it("forgets a connection that ended, but not that the robot is stopped", () => {
    const state = createConsoleState();
    applyMessage(state, welcomeOf("operator"), 0);
    applyMessage(state, feedbackOf(5, { stop: stopOf({ stopped: true, by: "x" }) }), 0);
    forgetConnection(state);
    expect(state).toMatchObject({ welcome: null, feedback: null, seat: null, robot: null });
    expect(state.stop.stopped).toBe(true);
  });

  it("takes no older stop for the newest, but for the first of a connection", () => {
    const state = createConsoleState();
    applyMessage(state, { type: "stop_state", stop: stopOf({ number: 5 }), event: 3 }, 0);
    applyMessage(state, feedbackOf(3, { stop: stopOf({ stopped: true, number: 4 }) }), 0);
    expect(state.stop).toMatchObject({ stopped: false, number: 5 });
    forgetConnection(state);
    applyMessage(state, { type: "stop_state", stop: stopOf({ stopped: true, number: 1 }), event: 3 }, 0);
    expect(state.stop).toMatchObject({ stopped: true, number: 1 });
  });

  it("logs what to do about a refused reset", () => {
    takeResetWords(RESET_WORDS);
    const state = createConsoleState();
    applyMessage(state, { ...refusalOf(0, "stale_reset"), stop: 5 }, 1);
    expect(state.log[0]?.text).toMatch(/^Not reset: somebody pressed STOP again/);
  });
});
