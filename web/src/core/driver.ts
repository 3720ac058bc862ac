import type { ClientMessage, Feedback, Refusal } from "../wire";
import {
  gateState,
  nextCommand,
  noteSent,
  takeFeedback,
  takeRefusal,
  createCommandGate,
  type CommandGate,
  type Pacing,
} from "./command_gate";
import { createLatency, noteCommandRefused, noteCommandSent, noteFeedback, type Latency } from "./latency";
import { createRepeatTimer, takeSample, waitAfter, type RepeatTimer } from "./repeat_timer";
import { isNewer } from "./serial";

/** While armed and at rest, neutral commands keep forces felt and the link proven. */
const IDLE_INTERVAL_MS = 200;
/** A rest that is never confirmed is given up: the robot's own hold has long ended. */
const REST_GIVE_UP_MS = 5000;

/** What the operator wants now. */
export interface Intention {
  readonly armed: boolean;
  readonly values: readonly number[]; // one per axis; at rest unless the deadman is held
}

/** Turns intentions into commands, rests and repeats of them. Holds no clock and no socket. */
export interface Driver {
  readonly gate: CommandGate;
  readonly repeat: RepeatTimer;
  readonly latency: Latency;
  readonly neutral: readonly number[]; // the axes' rest values
  sends: number; // of the event in flight
  repeatAtMs: number;
  lastValues: readonly number[]; // sent last
  neutralOwed: boolean; // one neutral command is due after disarming
  barrier: number | null; // events up to this one were voided by a rest: only neutral goes under their numbers
  rest: { event: number; sends: number; atMs: number; sinceMs: number } | null; // until the robot is at rest
}

export function createDriver(
  pacing: Pacing,
  tolerance: number,
  minIntervalMs: number,
  neutral: readonly number[],
): Driver {
  return {
    gate: createCommandGate(pacing, tolerance, minIntervalMs),
    repeat: createRepeatTimer(),
    latency: createLatency(),
    neutral,
    sends: 0,
    repeatAtMs: 0,
    lastValues: neutral,
    neutralOwed: false,
    barrier: null,
    rest: null,
  };
}

/** Takes a feedback; says whether it was news. `canCommand`: whether a neutral command could still be executed. */
export function driverFeedback(
  driver: Driver,
  feedback: Feedback,
  canCommand: boolean,
  now: number,
): boolean {
  const { gate, rest } = driver;
  const sends = driver.sends;
  const flying = gate.inFlight;
  if (!takeFeedback(gate, feedback.event, feedback.issue)) return false;
  const sample = noteFeedback(driver.latency, feedback.event, now);
  // Karn's rule: which of several sends was answered cannot be told, so only a single send is a sample.
  if (sample !== null && sends === 1 && flying === feedback.event) takeSample(driver.repeat, sample);
  if (driver.barrier !== null && !isNewer(driver.barrier, feedback.event)) driver.barrier = null;
  if (rest !== null && feedback.at_rest && (!canCommand || isNewer(feedback.event, rest.event)))
    driver.rest = null;
  return true;
}

export function driverRefusal(driver: Driver, refusal: Refusal, armed: boolean): void {
  if (!takeRefusal(driver.gate, refusal.event)) return;
  noteCommandRefused(driver.latency, refusal.event);
  if (refusal.reason === "rested") driver.barrier = refusal.event;
  const mayRepeat =
    refusal.reason === "late" || refusal.reason === "rested" || refusal.reason === "out_of_order";
  if (!armed && mayRepeat) driver.neutralOwed = true;
}

/** The deadman was let go: brings the robot to rest at once, past the gate. */
export function driverRelease(driver: Driver, now: number): void {
  const event = driver.gate.inFlight ?? driver.gate.event;
  if (event === null) return;
  driver.rest = { event, sends: 0, atMs: now, sinceMs: now };
  driver.barrier = event;
}

/** Disarmed: rest, one neutral, then silence. */
export function driverDisarm(driver: Driver, now: number): void {
  driverRelease(driver, now);
  driver.neutralOwed = true;
}

/** Nothing sent from here can be executed any more (seat lost, robot link down). */
export function driverSilence(driver: Driver): void {
  driver.gate.inFlight = null;
  driver.neutralOwed = false;
  driver.rest = null;
}

/** What to send now. Called at a fixed rate and after every feedback. */
export function driverStep(
  driver: Driver,
  intention: Intention,
  canCommand: boolean,
  now: number,
): ClientMessage[] {
  const out: ClientMessage[] = [];
  const rest = restDue(driver, now);
  if (rest !== null) out.push(rest);
  const command = canCommand || driver.gate.inFlight !== null ? commandDue(driver, intention, now) : null;
  if (command !== null) out.push(command);
  return out;
}

function restDue(driver: Driver, now: number): ClientMessage | null {
  const { rest } = driver;
  if (rest === null || now < rest.atMs) return null;
  if (now - rest.sinceMs > REST_GIVE_UP_MS) {
    driver.rest = null;
    return null;
  }
  rest.sends += 1;
  rest.atMs = now + waitAfter(driver.repeat, rest.sends);
  return { type: "rest", event: rest.event };
}

function commandDue(driver: Driver, intention: Intention, now: number): ClientMessage | null {
  const next = nextCommand(driver.gate);
  if (next === null) return null;
  const isVoided = driver.barrier !== null && !isNewer(next.event, driver.barrier);
  const values = intention.armed && !isVoided ? intention.values : driver.neutral;
  if (driver.gate.inFlight !== null) {
    if (now < driver.repeatAtMs) return null;
    driver.sends += 1;
  } else {
    if (!wantsToSend(driver, intention.armed, values, now)) return null;
    noteSent(driver.gate, now);
    noteCommandSent(driver.latency, next.event, now);
    driver.sends = 1;
    driver.neutralOwed &&= intention.armed;
  }
  driver.repeatAtMs = now + waitAfter(driver.repeat, driver.sends);
  driver.lastValues = values;
  return { type: "command", event: next.event, issue: next.issue, values };
}

function wantsToSend(driver: Driver, armed: boolean, values: readonly number[], now: number): boolean {
  if (gateState(driver.gate, now) !== "open") return false;
  if (!armed) return driver.neutralOwed;
  const idles = isSame(values, driver.neutral) && isSame(driver.lastValues, driver.neutral);
  return !idles || now - driver.gate.lastSentMs >= IDLE_INTERVAL_MS;
}

function isSame(left: readonly number[], right: readonly number[]): boolean {
  return left.length === right.length && left.every((value, index) => value === right[index]);
}
