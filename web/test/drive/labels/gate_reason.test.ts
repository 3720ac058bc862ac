import { describe, expect, it } from "vitest";
import { applyMessage, createConsoleState, forgetConnection } from "../../../src/session/console_state";
import { gateReason } from "../../../src/drive/labels/gate_reason";
import { feedbackOf, robotOf, seatOf, stopOf, welcomeOf } from "../../messages";

function driving(): ReturnType<typeof createConsoleState> {
  const state = createConsoleState();
  applyMessage(state, welcomeOf("operator"), 0);
  applyMessage(state, robotOf("up"), 0);
  applyMessage(state, seatOf("me", "somebody"), 0);
  return state;
}

describe("the gate", () => {
  it("is left to its own rule for who holds the seat of a robot that can be reached", () => {
    expect(gateReason(driving(), true, false)).toBeNull();
  });

  it("is shut before that without a connection", () => {
    const state = driving();
    forgetConnection(state);
    expect(gateReason(state, true, false)).toBe("not_connected");
  });

  it("is shut while the console is silent, whatever was true when it last spoke", () => {
    expect(gateReason(driving(), false, false)).toBe("console_silent");
    const state = driving();
    applyMessage(state, robotOf("down", "silent"), 0);
    expect(gateReason(state, false, false)).toBe("console_silent");
    forgetConnection(state);
    expect(gateReason(state, false, false)).toBe("not_connected");
  });

  it("is shut while the robot cannot be reached, whatever else holds", () => {
    const state = driving();
    applyMessage(state, feedbackOf(5, { stop: stopOf({ stopped: true, by: "Ada", reason: "test" }) }), 0);
    applyMessage(state, robotOf("down", "silent"), 0);
    expect(gateReason(state, true, false)).toBe("robot_down");
  });

  it("is shut while the robot is stopped", () => {
    const state = driving();
    applyMessage(state, feedbackOf(5, { stop: stopOf({ stopped: true, by: "Ada", reason: "test" }) }), 0);
    expect(gateReason(state, true, false)).toBe("stopped");
  });

  it("is shut from a press of STOP on, and does not say that the robot is stopped", () => {
    expect(gateReason(driving(), true, true)).toBe("stop_pressed");
  });

  it("is shut for who does not hold the seat", () => {
    const state = driving();
    applyMessage(state, seatOf("other", "Ada"), 0);
    expect(gateReason(state, true, false)).toBe("no_seat");
  });
});
