import { beforeEach, describe, expect, it } from "vitest";
import {
  createDriver,
  driverArm,
  driverBar,
  driverDisarm,
  driverFeedback,
  driverLoss,
  driverMayMove,
  driverOpensIn,
  driverPingAnswered,
  driverRefusal,
  driverRelease,
  driverSilence,
  driverStep,
  type Driver,
} from "../../src/drive/driver";
import { noteHeard } from "../../src/drive/command_gate";
import { MAX_EVENT } from "../../src/gate/serial";
import type { ClientMessage } from "../../src/protocol/wire";
import { feedbackOf, refusalOf } from "../messages";

const NEUTRAL = [0, 0];
const MOVING = { armed: true, values: [1, 0] };
const IDLE = { armed: true, values: NEUTRAL };
const DISARMED = { armed: false, values: NEUTRAL };

let driver: Driver;

beforeEach(() => {
  driver = createDriver("feedback", 4, 0, NEUTRAL);
  proven(driver);
  driverFeedback(driver, feedbackOf(1), true, 0);
});

/** As one that was armed and whose neutral command was answered. */
function proven(fresh: Driver): void {
  driverArm(fresh);
  fresh.unproven = false;
}

function commands(messages: ClientMessage[]): ClientMessage[] {
  return messages.filter((message) => message.type === "command");
}

function rests(messages: ClientMessage[]): ClientMessage[] {
  return messages.filter((message) => message.type === "rest");
}

describe("commands", () => {
  it("go as soon as the gate is open, one event at a time", () => {
    expect(driverStep(driver, MOVING, true, 0)).toEqual([
      { type: "command", event: 2, issue: 1, nonce: 0, values: [1, 0] },
    ]);
    expect(driverStep(driver, MOVING, true, 10)).toEqual([]);
    driverFeedback(driver, feedbackOf(2), true, 12);
    expect(driverStep(driver, MOVING, true, 12)).toEqual([
      { type: "command", event: 3, issue: 1, nonce: 0, values: [1, 0] },
    ]);
  });

  it("tell how long the event rate alone holds the next one back", () => {
    driver = createDriver("feedback", 4, 16, NEUTRAL, 40);
    proven(driver);
    driverFeedback(driver, feedbackOf(1), true, 0);
    expect(driverOpensIn(driver, MOVING, 0)).toBeNull();
    expect(driverStep(driver, MOVING, true, 0)).toHaveLength(1);
    expect(driverOpensIn(driver, MOVING, 4)).toBeNull(); // in flight
    driverFeedback(driver, feedbackOf(2), true, 5);
    expect(driverOpensIn(driver, MOVING, 5)).toBe(11);
    expect(driverStep(driver, MOVING, true, 15)).toEqual([]);
    expect(driverStep(driver, MOVING, true, 16)).toHaveLength(1);
  });

  it("wait for sound that they would make too old, for half of the robot's hold, but not where they only let go", () => {
    driver = createDriver("feedback", 4, 16, NEUTRAL, 40, 300);
    proven(driver);
    driverFeedback(driver, feedbackOf(1), true, 0);
    expect(driverStep(driver, MOVING, true, 0)).toHaveLength(1);
    driverFeedback(driver, feedbackOf(2), true, 5);
    const segment = { stamp: MAX_EVENT - 1, atMs: 5, leftOut: 0 };
    noteHeard(driver.gate, [{ microphone: "front", segment, tolerance: 4 }], 5);
    expect(driverOpensIn(driver, MOVING, 5)).toBe(145);
    expect(driverStep(driver, MOVING, true, 40)).toEqual([]);
    const released = { ...MOVING, values: NEUTRAL };
    expect(driverOpensIn(driver, { ...released, action: "dock" }, 5)).toBe(145);
    expect(driverOpensIn(driver, released, 5)).toBe(35);
    expect(driverStep(driver, released, true, 40)).toHaveLength(1);
  });

  it("name the action that an armed page lets go on, at every answer and never after disarming", () => {
    const HOMING = { ...IDLE, action: "id" };
    expect(driverStep(driver, HOMING, true, 0)).toMatchObject([{ action: "id", values: NEUTRAL }]);
    driverFeedback(driver, feedbackOf(2), true, 12);
    expect(driverStep(driver, HOMING, true, 12), "not only five times a second").toMatchObject([
      { action: "id" },
    ]);
    driverFeedback(driver, feedbackOf(3), true, 24);
    driverDisarm(driver, 24);
    const after = commands(driverStep(driver, { ...HOMING, armed: false }, true, 24));
    expect(after).toHaveLength(1);
    expect(after[0]).not.toHaveProperty("action");
  });

  it("name the nonce of the issue that they answer, also when repeated", () => {
    driverFeedback(driver, feedbackOf(1, { issue: 2, nonce: 12 }), true, 1);
    expect(driverStep(driver, MOVING, true, 2)).toMatchObject([{ issue: 2, nonce: 12 }]);
    driverFeedback(driver, feedbackOf(1, { issue: 3, nonce: 13 }), true, 50);
    expect(driverStep(driver, MOVING, true, 150)).toMatchObject([{ issue: 3, nonce: 13 }]);
  });

  it("are repeated under the same event with the newest intention and issue", () => {
    driverStep(driver, MOVING, true, 0);
    driverFeedback(driver, feedbackOf(1, { issue: 2 }), true, 50);
    expect(driverStep(driver, { armed: true, values: [0.5, 0] }, true, 100)).toEqual([
      { type: "command", event: 2, issue: 2, nonce: 0, values: [0.5, 0] },
    ]);
    expect(driverStep(driver, MOVING, true, 150)).toEqual([]);
    expect(driverStep(driver, MOVING, true, 200)).toHaveLength(1);
  });

  it("are copied three times on a lossy path, and then as salvos that end with the answer", () => {
    driverLoss(driver, 0);
    const sent = driverStep(driver, MOVING, true, 0);
    for (const copyMs of [20, 40, 60]) expect(driverStep(driver, MOVING, true, copyMs)).toEqual(sent);
    expect(driverStep(driver, MOVING, true, 99)).toEqual([]);
    expect(driverStep(driver, MOVING, true, 100)).toEqual(sent);
    expect(driverStep(driver, MOVING, true, 107)).toHaveLength(2);
    expect(driverStep(driver, MOVING, true, 180)).toHaveLength(9);
    expect(driverStep(driver, MOVING, true, 199)).toEqual([]);
    expect(driverStep(driver, MOVING, true, 200)).toEqual(sent);
    expect(driverStep(driver, MOVING, true, 207)).toHaveLength(2);
    driverFeedback(driver, feedbackOf(2), true, 208);
    expect(commands(driverStep(driver, DISARMED, true, 500))).toEqual([]);
  });

  it("are repeated one by one until a round trip has passed, and then as salvos", () => {
    driverPingAnswered(driver, 600);
    driverLoss(driver, 0);
    const sent = driverStep(driver, MOVING, true, 0);
    for (const copyMs of [20, 40, 60]) expect(driverStep(driver, MOVING, true, copyMs)).toEqual(sent);
    expect(driverStep(driver, MOVING, true, 500)).toEqual(sent);
    expect(driverStep(driver, MOVING, true, 550)).toEqual([]);
    expect(driverStep(driver, MOVING, true, 1000)).toEqual(sent);
    expect(driverStep(driver, MOVING, true, 1007)).toHaveLength(2);
  });

  it("do not go while nothing could execute them", () => {
    expect(driverStep(driver, MOVING, false, 0)).toEqual([]);
  });

  it("do not go before the first feedback", () => {
    expect(driverStep(createDriver("feedback", 4, 0, NEUTRAL), MOVING, true, 0)).toEqual([]);
  });

  it("are neutral, five times a second, while armed and at rest", () => {
    expect(commands(driverStep(driver, IDLE, true, 1000))).toHaveLength(1);
    driverFeedback(driver, feedbackOf(2), true, 1005);
    expect(driverStep(driver, IDLE, true, 1100)).toEqual([]);
    expect(commands(driverStep(driver, IDLE, true, 1200))).toHaveLength(1);
  });

  it("the first neutral after moving goes at once", () => {
    driverStep(driver, MOVING, true, 0);
    driverFeedback(driver, feedbackOf(2), true, 5);
    expect(commands(driverStep(driver, IDLE, true, 6))).toHaveLength(1);
  });

  it("of one send are samples for the repeat timer, those whose repeat may have been answered are not", () => {
    driverStep(driver, MOVING, true, 0);
    driverFeedback(driver, feedbackOf(2), true, 8);
    expect(driver.repeat.smoothedMs).toBe(8);
    driverStep(driver, MOVING, true, 10);
    driverStep(driver, MOVING, true, 500);
    driverFeedback(driver, feedbackOf(3), true, 700);
    expect(driver.repeat.smoothedMs).toBe(8);
  });

  it("whose feedback was issued again by itself are no samples", () => {
    driverStep(driver, MOVING, true, 0);
    driverFeedback(driver, feedbackOf(2, { issue: 2 }), true, 90);
    expect(driver.repeat.smoothedMs).toBeNull();
  });

  it("an old feedback is no news", () => {
    expect(driverFeedback(driver, feedbackOf(1), true, 1)).toBe(false);
  });
});

describe("letting go", () => {
  it("sends rest at once, past the gate, naming the event in flight", () => {
    driverStep(driver, MOVING, true, 0);
    driverRelease(driver, 3);
    expect(driverStep(driver, IDLE, true, 3)).toEqual([{ type: "rest", event: 2 }]);
  });

  it("names the current event when nothing is in flight", () => {
    driverRelease(driver, 3);
    expect(rests(driverStep(driver, IDLE, true, 3))).toEqual([{ type: "rest", event: 1 }]);
  });

  it("repeats the rest until the robot is at rest after a later event", () => {
    driverStep(driver, MOVING, true, 0);
    driverRelease(driver, 3);
    driverStep(driver, IDLE, true, 3);
    driverFeedback(driver, feedbackOf(2, { at_rest: true }), true, 10);
    expect(rests(driverStep(driver, IDLE, true, 103))).toHaveLength(1);
    driverFeedback(driver, feedbackOf(3, { at_rest: false }), true, 110);
    expect(rests(driverStep(driver, IDLE, true, 210))).toHaveLength(1);
    driverFeedback(driver, feedbackOf(4, { at_rest: true }), true, 250);
    expect(rests(driverStep(driver, IDLE, true, 900))).toEqual([]);
  });

  it("ends the rest at the first feedback at rest when no command can follow", () => {
    driverRelease(driver, 0);
    driverFeedback(driver, feedbackOf(1, { issue: 2 }), false, 10);
    expect(driver.rest).toBeNull();
  });

  it("gives the rest up when it is never confirmed", () => {
    driverRelease(driver, 0);
    expect(rests(driverStep(driver, DISARMED, false, 5001))).toEqual([]);
    expect(driver.rest).toBeNull();
  });

  it("sends nothing that moves under an event that the rest made void", () => {
    driverStep(driver, MOVING, true, 0);
    driverRelease(driver, 3);
    const repeat = commands(driverStep(driver, MOVING, true, 100));
    expect(repeat).toEqual([{ type: "command", event: 2, issue: 1, nonce: 0, values: NEUTRAL }]);
    driverFeedback(driver, feedbackOf(2), true, 110);
    expect(commands(driverStep(driver, MOVING, true, 110))).toMatchObject([{ event: 3, values: [1, 0] }]);
  });

  it("before the first feedback there is nothing to bring to rest", () => {
    const fresh = createDriver("feedback", 4, 0, NEUTRAL);
    driverRelease(fresh, 0);
    expect(driverStep(fresh, IDLE, true, 0)).toEqual([]);
  });
});

describe("disarming", () => {
  it("sends rest, one neutral, then nothing", () => {
    driverStep(driver, MOVING, true, 0);
    driverFeedback(driver, feedbackOf(2, { at_rest: false }), true, 5);
    driverDisarm(driver, 6);
    expect(driverStep(driver, DISARMED, true, 6)).toEqual([
      { type: "rest", event: 2 },
      { type: "command", event: 3, issue: 1, nonce: 0, values: NEUTRAL },
    ]);
    driverFeedback(driver, feedbackOf(3), true, 12);
    for (let now = 12; now < 3000; now += 10) expect(driverStep(driver, DISARMED, true, now)).toEqual([]);
  });

  it("turns the repeats of the event in flight neutral", () => {
    driverStep(driver, MOVING, true, 0);
    driverDisarm(driver, 1);
    expect(commands(driverStep(driver, DISARMED, true, 100))).toMatchObject([{ event: 2, values: NEUTRAL }]);
  });

  it("owes the neutral again when it was refused as late", () => {
    driverDisarm(driver, 0);
    expect(commands(driverStep(driver, DISARMED, true, 0))).toHaveLength(1);
    driverRefusal(driver, refusalOf(2, "late"), false);
    expect(commands(driverStep(driver, DISARMED, true, 1))).toHaveLength(1);
    driverRefusal(driver, refusalOf(2, "no_seat"), false);
    expect(commands(driverStep(driver, DISARMED, true, 2))).toHaveLength(0);
  });

  it("falls silent at once when nothing can be executed any more", () => {
    driverStep(driver, MOVING, true, 0);
    driverDisarm(driver, 1);
    driverSilence(driver);
    expect(driverStep(driver, DISARMED, false, 500)).toEqual([]);
  });
});

describe("refusals", () => {
  it("of another event change nothing", () => {
    driverStep(driver, MOVING, true, 0);
    driverRefusal(driver, refusalOf(9, "late"), true);
    expect(driver.gate.inFlight).toBe(2);
  });

  it("for a rest that named the event let only neutral follow under it", () => {
    driverStep(driver, MOVING, true, 0);
    driverRefusal(driver, refusalOf(2, "rested"), true);
    expect(commands(driverStep(driver, MOVING, true, 300))).toMatchObject([{ event: 2, values: NEUTRAL }]);
  });
});

describe("the neutral command that lets the robot move", () => {
  it("does not leave before the person has armed, whatever was owed", () => {
    driverStep(driver, MOVING, true, 0);
    driverBar(driver);
    driverDisarm(driver, 1);
    for (let now = 1; now < 3000; now += 10)
      expect(commands(driverStep(driver, DISARMED, true, now))).toEqual([]);
    driverRefusal(driver, refusalOf(2, "late"), false);
    driverFeedback(driver, feedbackOf(2), true, 3000);
    expect(commands(driverStep(driver, DISARMED, true, 3001))).toEqual([]);
  });

  it("does not leave from a page that has just connected", () => {
    const fresh = createDriver("feedback", 4, 0, NEUTRAL);
    driverFeedback(fresh, feedbackOf(1), true, 0);
    driverDisarm(fresh, 0);
    expect(commands(driverStep(fresh, DISARMED, true, 0))).toEqual([]);
  });

  it("leaves at once on arming, and nothing that moves leaves before its answer", () => {
    driverBar(driver);
    driverArm(driver);
    expect(commands(driverStep(driver, MOVING, true, 0))).toMatchObject([{ event: 2, values: NEUTRAL }]);
    expect(commands(driverStep(driver, MOVING, true, 100))).toMatchObject([{ event: 2, values: NEUTRAL }]);
    driverFeedback(driver, feedbackOf(1, { issue: 2 }), true, 110);
    expect(driver.unproven).toBe(true);
    driverFeedback(driver, feedbackOf(2), true, 120);
    expect(commands(driverStep(driver, MOVING, true, 120))).toMatchObject([{ event: 3, values: [1, 0] }]);
  });

  it("is not the moving one that was in flight when the person disarmed and armed again", () => {
    driverStep(driver, MOVING, true, 0);
    driverDisarm(driver, 1);
    driverArm(driver);
    driverFeedback(driver, feedbackOf(2), true, 5);
    expect(commands(driverStep(driver, MOVING, true, 5))).toMatchObject([{ event: 3, values: NEUTRAL }]);
  });

  it("goes again when it was refused as late", () => {
    driverBar(driver);
    driverArm(driver);
    driverStep(driver, MOVING, true, 0);
    driverRefusal(driver, refusalOf(2, "late"), true);
    expect(commands(driverStep(driver, MOVING, true, 1))).toMatchObject([{ event: 2, values: NEUTRAL }]);
  });
});

it("a command names the nonce of the issue that it answers, its repeats that of the newest", () => {
  driverFeedback(driver, feedbackOf(1, { issue: 2, nonce: 77 }), true, 1);
  expect(driverStep(driver, MOVING, true, 1)).toMatchObject([{ issue: 2, nonce: 77 }]);
  driverFeedback(driver, feedbackOf(1, { issue: 3, nonce: 78 }), true, 2);
  expect(driverStep(driver, MOVING, true, 101)).toMatchObject([{ issue: 3, nonce: 78 }]);
  driverFeedback(driver, feedbackOf(2, { nonce: 79 }), true, 102);
  expect(driverStep(driver, MOVING, true, 102)).toMatchObject([{ event: 3, issue: 1, nonce: 79 }]);
});

describe("a robot with goal axes", () => {
  const STAY = [0, null];
  const stays = { armed: true, values: STAY };

  beforeEach(() => {
    driver = createDriver("feedback", 4, 0, STAY);
    proven(driver);
    driverFeedback(driver, feedbackOf(1), true, 0);
  });

  it("is told to stay at the slow rate of an idle page, and a goal where it is moves it", () => {
    expect(commands(driverStep(driver, stays, true, 0))).toHaveLength(1);
    driverFeedback(driver, feedbackOf(2), true, 10);
    expect(driverStep(driver, stays, true, 10)).toEqual([]);
    const [command] = commands(driverStep(driver, { armed: true, values: [0, 0] }, true, 20));
    expect(command).toEqual({ type: "command", event: 3, issue: 1, nonce: 0, values: [0, 0] });
  });

  it("is told the speed that the hand asks for, by commands that may move it", () => {
    const slow = { armed: true, values: [0, 1], speed: 0.25 };
    expect(commands(driverStep(driver, slow, true, 0))[0]).toMatchObject({ values: [0, 1], speed: 0.25 });
    driverFeedback(driver, feedbackOf(2), true, 10);
    driverDisarm(driver, 20);
    const [after] = commands(driverStep(driver, { ...slow, armed: false }, true, 20));
    expect(after).toMatchObject({ values: STAY });
    expect(after).not.toHaveProperty("speed");
  });

  it("may be moved by the next command only when it was armed and proven, and is not resting", () => {
    expect(driverMayMove(driver)).toBe(true);
    driverRelease(driver, 0);
    expect(driverMayMove(driver)).toBe(true); // the newest event is voided, the next one is not
    commands(driverStep(driver, { armed: true, values: [0, 1] }, true, 0));
    driverRelease(driver, 5);
    expect(driverMayMove(driver)).toBe(false);
    driverFeedback(driver, feedbackOf(2), true, 10);
    expect(driverMayMove(driver)).toBe(true);
    driverArm(driver);
    expect(driverMayMove(driver)).toBe(false);
    driverBar(driver);
    expect(driverMayMove(driver)).toBe(false);
    expect(driverMayMove(createDriver("feedback", 4, 0, STAY))).toBe(false);
  });

  it("is never sent a goal after disarming, not by a repeat either", () => {
    driverStep(driver, { armed: true, values: [0, 1] }, true, 0);
    driverDisarm(driver, 10);
    for (let now = 10; now < 2000; now += 10)
      for (const message of commands(driverStep(driver, { armed: false, values: [0, 1] }, true, now)))
        expect(message).toMatchObject({ values: STAY });
  });
});
