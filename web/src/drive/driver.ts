import type { ClientMessage, Feedback, Refusal, ServerMessage } from "../protocol/wire";
import {
  gateState,
  nextCommand,
  noteSent,
  opensAt,
  takeFeedback,
  takeRefusal,
  createCommandGate,
  type CommandGate,
  type Pacing,
} from "./command_gate";
import { createLatency, noteCommandRefused, noteCommandSent, noteFeedback, type Latency } from "./latency";
import {
  createRepeatTimer,
  earlyInterval,
  INITIAL_MS,
  takeSample,
  waitAfter,
  type RepeatTimer,
} from "./repeat_timer";
import { isNewer } from "../gate/serial";

/** While armed and at rest, neutral commands keep forces felt and the link proven. */
const IDLE_INTERVAL_MS = 200;
/** A rest that is never confirmed is given up: the robot's own hold has long ended. */
const REST_GIVE_UP_MS = 5000;
/** A copy comes this much later: longer than the console's own path to the robot and back. */
const ECHO_MS = 20;
/** So many at most, until the answer; with the command itself as many as a row of lost packets is long. */
const ECHOES = 3;
/** Each repeat on such a path: so many copies, until the answer. */
const SALVO = 12;
const SALVO_SPACING_MS = 3;
/** With a shorter interval single repeats are as quick. */
const SALVO_LEAST_MS = 50;
/** To go on copying after the last loss that was seen. */
const LOSSY_SPELL_MS = 60_000;
/** An answer within this part of a ping's round trip after the last repeat answers an earlier sending. */
const NEEDLESS = 0.75;
/** Of the whole wait, while no ping is known. */
const NEEDLESS_BLIND = 0.25;
/** Of which the shortest counts. */
const PINGS = 8;
const FEW_SAMPLES = 8;

/** What the operator wants now. */
export interface Intention {
  readonly armed: boolean;
  readonly values: readonly (number | null)[]; // one per axis; at rest unless the deadman is held
  readonly speed?: number; // 0 to 1, of the goal axes' largest
  readonly action?: string; // id of the moving action that this page lets go on; "" for none
}

/**
 * Turns intentions into commands, rests and repeats of them. Holds no clock and no socket.
 *
 * After a stop, a reset, a fault or another link the robot asks for a neutral command before one that moves. That
 * command stands for a person's decision: none leaves after `driverBar` before `driverArm`, and then none that moves
 * before it was answered.
 *
 * While the path loses packets every command is followed by copies until its answer: a copy covers the loss of the
 * command and, being answered from the stored feedback, the loss of the answer too. When all were lost, the first
 * repeat comes early, and each repeat is a salvo: single repeats would wait out a row of lost packets one by one. A
 * repeat that leaves before an answer can have come is single. On a clean path nothing is copied.
 */
export interface Driver {
  readonly gate: CommandGate;
  readonly repeat: RepeatTimer;
  readonly latency: Latency;
  readonly neutral: readonly (number | null)[]; // what moves no axis
  sends: number; // of the event in flight; its echo does not count
  lastSentMs: number; // the last of them
  repeatAtMs: number;
  echoAtMs: number; // Infinity when no copy is due
  echoesLeft: number;
  lossyUntilMs: number; // -Infinity before the first loss
  readonly pings: number[]; // their round trips in ms, newest last; none of a command is shorter
  lastValues: readonly (number | null)[]; // sent last
  neutralOwed: boolean; // one neutral command is due after disarming
  barred: boolean; // nothing but rests leaves until the person has armed
  unproven: boolean; // armed, and no neutral command was answered since
  askedAgain: boolean; // the answer to that command asked for one more
  flightIsNeutral: boolean; // what the event in flight was first sent with
  barrier: number | null; // events up to this one were voided by a rest: only neutral goes under their numbers
  rest: { event: number; sends: number; atMs: number; sinceMs: number } | null; // until the robot is at rest
}

export function createDriver(
  pacing: Pacing,
  tolerance: number,
  minIntervalMs: number,
  neutral: readonly (number | null)[],
  calmIntervalMs = minIntervalMs,
  holdMs = Infinity,
): Driver {
  return {
    gate: createCommandGate(pacing, tolerance, minIntervalMs, calmIntervalMs, holdMs),
    repeat: createRepeatTimer(),
    latency: createLatency(),
    neutral,
    sends: 0,
    lastSentMs: -Infinity,
    repeatAtMs: 0,
    echoAtMs: Infinity,
    echoesLeft: 0,
    lossyUntilMs: -Infinity,
    pings: [],
    lastValues: neutral,
    neutralOwed: false,
    barred: true,
    unproven: false,
    askedAgain: false,
    flightIsNeutral: false,
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
  const flying = gate.inFlight;
  if (!takeFeedback(gate, feedback.event, feedback.issue, feedback.nonce)) return false;
  if (flying !== null && gate.inFlight === null && driver.flightIsNeutral) {
    driver.askedAgain = feedback.neutral_needed;
    driver.unproven &&= feedback.neutral_needed;
  }
  const sample = noteFeedback(driver.latency, feedback.event, now);
  if (sample !== null && flying === feedback.event) landed(driver, feedback.issue, sample, now);
  if (driver.barrier !== null && !isNewer(driver.barrier, feedback.event)) driver.barrier = null;
  if (rest !== null && feedback.at_rest && (!canCommand || isNewer(feedback.event, rest.event)))
    driver.rest = null;
  return true;
}

/**
 * Karn's rule: a command whose repeat may have been the one answered is no sample. Taken to the letter, the first
 * repeat would come too soon for ever on a path longer than the interval, so a repeat that was needless still counts.
 */
function landed(driver: Driver, issue: number, takenMs: number, now: number): void {
  // Echoes make a sample too long at times, which is the safe side.
  const soonest = driver.pings.length > 0 ? NEEDLESS * Math.min(...driver.pings) : NEEDLESS_BLIND * takenMs;
  const answers = driver.sends === 1 || now - driver.lastSentMs < soonest;
  // A later issue of this feedback came by itself, not as an answer.
  if (issue === 1 && answers) takeSample(driver.repeat, takenMs);
  else driverLoss(driver, now);
}

/** A ping's round trip: stands in for that of a command while few of those are known. */
export function driverPingAnswered(driver: Driver, roundTripMs: number): void {
  driver.pings.push(roundTripMs);
  if (driver.pings.length > PINGS) driver.pings.shift();
  if (knowsFewCommands(driver)) takeSample(driver.repeat, roundTripMs);
}

/** Some message of this connection was lost. */
export function driverLoss(driver: Driver, now: number): void {
  driver.lossyUntilMs = now + LOSSY_SPELL_MS;
}

export function driverRefusal(driver: Driver, refusal: Refusal, armed: boolean): void {
  if (!takeRefusal(driver.gate, refusal.event)) return;
  noteCommandRefused(driver.latency, refusal.event);
  if (refusal.reason === "rested") driver.barrier = refusal.event;
  const mayRepeat =
    refusal.reason === "late" || refusal.reason === "rested" || refusal.reason === "out_of_order";
  if (!armed && mayRepeat) driver.neutralOwed = !driver.barred;
}

/** The deadman was let go: brings the robot to rest at once, past the gate. */
export function driverRelease(driver: Driver, now: number): void {
  const event = driver.gate.inFlight ?? driver.gate.event;
  if (event === null) return;
  driver.rest = { event, sends: 0, atMs: now, sinceMs: now };
  driver.barrier = event;
}

/** The person has armed: a neutral command leaves, and what moves waits for its answer. */
export function driverArm(driver: Driver): void {
  driver.barred = false;
  driver.unproven = true;
  driver.askedAgain = false;
}

/**
 * Whether a robot that asks for a neutral command in `message`, not yet taken, only asks for the one that arming sends.
 * A command that answers an issue from before, say, a reset counts for nothing at the robot, so one more follows it. A
 * cause that outlives that one came after the person armed.
 */
export function driverAwaitsNeutral(driver: Driver, message: ServerMessage): boolean {
  if (!driver.unproven || !driver.askedAgain || message.type !== "feedback") return driver.unproven;
  const { inFlight } = driver.gate;
  return inFlight === null || isNewer(inFlight, message.event);
}

/** Disarmed: rest, one neutral unless that is barred, then silence. */
export function driverDisarm(driver: Driver, now: number): void {
  driverRelease(driver, now);
  driver.unproven = false;
  driver.neutralOwed = !driver.barred;
}

/** A stop, a reset, a fault, another link: what is under way is dropped, and the next command is the person's to give. */
export function driverBar(driver: Driver): void {
  if (driver.gate.inFlight !== null) noteCommandRefused(driver.latency, driver.gate.inFlight);
  driver.gate.inFlight = null;
  driver.neutralOwed = false;
  driver.unproven = false;
  driver.barred = true;
}

/** Nothing sent from here can be executed any more (seat lost, robot link down). */
export function driverSilence(driver: Driver): void {
  driverBar(driver);
  driver.rest = null;
}

/** What to send now. Called at the moments of the inputs, at every tick and after every feedback. */
export function driverStep(
  driver: Driver,
  intention: Intention,
  canCommand: boolean,
  now: number,
): ClientMessage[] {
  const out: ClientMessage[] = [];
  const rest = restDue(driver, now);
  if (rest !== null) out.push(rest);
  for (;;) {
    const command = canCommand || driver.gate.inFlight !== null ? commandDue(driver, intention, now) : null;
    if (command === null) return out;
    out.push(command);
  }
}

/** How long the event rate alone holds the next command back, in ms; null when it does not. */
export function driverOpensIn(driver: Driver, intention: Intention, now: number): number | null {
  const { gate } = driver;
  const letsGo = onlyLetsGo(driver, intention);
  return gateState(gate, now, letsGo) === "rate" ? opensAt(gate, letsGo) - now : null;
}

/** Whether the next command is neutral and renews no action. */
function onlyLetsGo(driver: Driver, intention: Intention): boolean {
  return (intention.action ?? "") === "" && isSame(wantedValues(driver, intention), driver.neutral);
}

function wantedValues(driver: Driver, { armed, values }: Intention): readonly (number | null)[] {
  return armed && driverMayMove(driver) ? values : driver.neutral;
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
  if (next === null || driver.barred) return null;
  const mayMove = intention.armed && driverMayMove(driver);
  const values = wantedValues(driver, intention);
  if (driver.gate.inFlight !== null) {
    if (now < Math.min(driver.repeatAtMs, driver.echoAtMs)) return null;
    if (now >= driver.repeatAtMs) noteSending(driver, driver.sends + 1, now);
    else noteEcho(driver);
  } else {
    if (!wantsToSend(driver, intention, values, now)) return null;
    noteSent(driver.gate, now);
    noteCommandSent(driver.latency, next.event, now);
    noteSending(driver, 1, now);
    driver.neutralOwed &&= intention.armed;
    driver.flightIsNeutral = isSame(values, driver.neutral);
  }
  driver.lastValues = values;
  // Only an armed page lets an action go on: what it sends after disarming names none.
  const { action = "", speed = 1 } = intention;
  return {
    type: "command",
    ...next,
    values,
    ...(action !== "" && mayMove ? { action } : {}),
    ...(speed < 1 && mayMove ? { speed } : {}),
  };
}

/** Whether the next command of one who is armed may move the robot. */
export function driverMayMove({ gate, barrier, barred, unproven }: Driver): boolean {
  const next = nextCommand(gate);
  return next !== null && !barred && !unproven && (barrier === null || isNewer(next.event, barrier));
}

function noteSending(driver: Driver, sends: number, now: number): void {
  driver.sends = sends;
  driver.lastSentMs = now;
  // A ping does not reach the robot: until its share is known, pings may lengthen the wait but not shorten it.
  const least = knowsFewCommands(driver) ? INITIAL_MS : 0;
  const waitMs = Math.max(least, waitAfter(driver.repeat, sends));
  driver.repeatAtMs = now + waitMs;
  driver.echoesLeft = 0;
  if (now < driver.lossyUntilMs) {
    const earlyMs = earlyInterval(driver.repeat);
    if (sends === 1) {
      driver.echoesLeft = ECHOES;
      if (earlyMs >= SALVO_LEAST_MS) driver.repeatAtMs = now + Math.max(least, earlyMs);
    } else if (waitMs >= SALVO_LEAST_MS && couldBeAnswered(driver, now)) driver.echoesLeft = SALVO - 1;
  }
  driver.echoAtMs = driver.echoesLeft === 0 ? Infinity : now + echoSpacing(driver);
}

/**
 * On a path longer than the interval the first repeats say nothing of losses. Salvos of them would fill the window that
 * SCTP has after a loss (RFC 9260 7.2.3: one packet), and what follows, heartbeats too, would wait behind them.
 */
function couldBeAnswered({ gate, pings }: Driver, now: number): boolean {
  return pings.length === 0 || now - gate.lastSentMs >= Math.min(...pings);
}

function noteEcho(driver: Driver): void {
  driver.echoesLeft -= 1;
  driver.echoAtMs = driver.echoesLeft === 0 ? Infinity : driver.echoAtMs + echoSpacing(driver);
}

function echoSpacing(driver: Driver): number {
  return driver.sends === 1 ? ECHO_MS : SALVO_SPACING_MS;
}

function knowsFewCommands(driver: Driver): boolean {
  return driver.latency.toFeedback.values.length < FEW_SAMPLES;
}

function wantsToSend(
  driver: Driver,
  intention: Intention,
  values: readonly (number | null)[],
  now: number,
): boolean {
  if (gateState(driver.gate, now, onlyLetsGo(driver, intention)) !== "open") return false;
  if (!intention.armed) return driver.neutralOwed;
  if (driver.unproven) return true;
  if ((intention.action ?? "") !== "") return true; // every answer is renewed at once
  const idles = isSame(values, driver.neutral) && isSame(driver.lastValues, driver.neutral);
  return !idles || now - driver.gate.lastSentMs >= IDLE_INTERVAL_MS;
}

function isSame(left: readonly (number | null)[], right: readonly (number | null)[]): boolean {
  return left.length === right.length && left.every((value, index) => value === right[index]);
}
