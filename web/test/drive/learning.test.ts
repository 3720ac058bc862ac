import { beforeEach, describe, expect, it } from "vitest";
import {
  createDriver,
  driverFeedback,
  driverLoss,
  driverPingAnswered,
  driverRefusal,
  driverSilence,
  driverStep,
  type Driver,
} from "../../src/drive/driver";
import { repeatInterval } from "../../src/drive/repeat_timer";
import { eventAfter } from "../../src/gate/serial";
import { feedbackOf, refusalOf } from "../messages";
import { readVectors } from "../vectors";

interface Step {
  at_ms: number;
  ping_ms?: number;
  loss?: boolean;
  command?: { sends_ms: number[]; answer_ms: number };
  interval_ms: number;
}

const { cases } = readVectors("learning") as { cases: { name: string; steps: Step[] }[] };
const MOVING = { armed: true, values: [1] };

let driver: Driver;

beforeEach(() => {
  driver = createDriver("feedback", 4, 0, [0]);
  driver.barred = false; // as after arming
  driverFeedback(driver, feedbackOf(1), true, 0);
});

/** Sends one command, steps every `tickMs`, answers it; when it was sent, in ms after `at`. */
function command(at: number, answerMs: number, tickMs = 1): number[] {
  const sends: number[] = [];
  for (let ms = 0; ms < answerMs; ms += tickMs)
    for (const message of driverStep(driver, MOVING, true, at + ms)) {
      expect(message).toMatchObject({ type: "command", event: eventAfter(driver.gate.event ?? 0) });
      sends.push(ms);
    }
  const event = eventAfter(driver.gate.event ?? 0);
  driverFeedback(driver, feedbackOf(event, { at_rest: false }), true, at + answerMs);
  return sends;
}

describe("the table that both consoles share", () => {
  it.each(cases)("$name", ({ steps }) => {
    for (const { at_ms, ping_ms, loss, command: sent, interval_ms } of steps) {
      if (ping_ms !== undefined) driverPingAnswered(driver, ping_ms);
      if (loss === true) driverLoss(driver, at_ms);
      if (sent !== undefined) expect(command(at_ms, sent.answer_ms)).toEqual(sent.sends_ms);
      expect(repeatInterval(driver.repeat)).toBeCloseTo(interval_ms, 4);
    }
  });
});

describe("a link of 250 ms", () => {
  it("is learnt from its first commands, and then nothing is repeated or copied", () => {
    const sends = Array.from({ length: 50 }, (_, index) => command(index * 260, 250, 10).length);
    expect(sends[0]).toBeGreaterThan(1);
    expect(sends.slice(1)).toEqual(Array<number>(49).fill(1));
    expect(driver.repeat.smoothedMs).toBeCloseTo(250, 0);
  });

  it("is learnt from pings, and then not even the first command is repeated", () => {
    for (let pings = 0; pings < 5; pings++) driverPingAnswered(driver, 250);
    const sends = Array.from({ length: 50 }, (_, index) => command(index * 260, 255, 10).length);
    expect(sends).toEqual(Array<number>(50).fill(1));
  });

  it("that loses a command copies the next ones for 60 s, and is still sampled", () => {
    for (let pings = 0; pings < 5; pings++) driverPingAnswered(driver, 250);
    const lostMs = repeatInterval(driver.repeat) + 250;
    expect(command(0, lostMs, 10)).toHaveLength(2);
    for (let at = 1000; at < lostMs + 60_000; at += 500)
      expect(command(at, 250, 10).slice(0, 5)).toEqual([0, 20, 40, 60]);
    expect(driver.repeat.smoothedMs).toBeCloseTo(250, 0);
    expect(command(lostMs + 60_000, 250, 10)).toEqual([0]);
  });
});

it("pings shorter than the robot's own delay do not make the first commands repeat", () => {
  for (let pings = 0; pings < 100; pings++) driverPingAnswered(driver, 2);
  for (let at = 0; at < 2000; at += 100) expect(command(at, 40)).toEqual([0]);
});

it("an echo carries the newest intention and issue", () => {
  driverLoss(driver, 0);
  driverStep(driver, MOVING, true, 0);
  driverFeedback(driver, feedbackOf(1, { issue: 2 }), true, 10);
  expect(driverStep(driver, { armed: true, values: [0.5] }, true, 20)).toEqual([
    { type: "command", event: 2, issue: 2, nonce: 0, values: [0.5] },
  ]);
});

it("a refused command is echoed no more", () => {
  driverLoss(driver, 0);
  driverStep(driver, MOVING, true, 0);
  driverRefusal(driver, refusalOf(2, "stopped"), false);
  expect(driverStep(driver, { armed: false, values: [0] }, false, 20)).toEqual([]);
});

it("a command that was in flight when the seat went is no sample when its number is used again", () => {
  driverStep(driver, MOVING, true, 0);
  driverSilence(driver);
  driver.barred = false;
  command(10_000, 40);
  expect(driver.repeat.smoothedMs).toBe(40);
});
