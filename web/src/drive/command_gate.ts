import { eventAfter, eventGap, isNewer } from "../gate/serial";
import { hear, isAwaited, mostBehind, type AwaitedSound, type HeardSegment } from "./awaited_sound";

export type Pacing = "feedback" | "media";

/** Events that follow one another sooner wait for pictures and sound; ms. */
export const CALM_INTERVAL_MS = 40;
/**
 * An event that would take sound out of its tolerance waits for it so long at most, and for half of the time for which
 * the robot holds a command; ms. Armed and at rest, events follow one another no sooner.
 */
export const SOUND_WAIT_MS = 200;
/**
 * With feedback pacing sound that fell silent is waited for so long, by each event as above: what is late may still
 * come. With media pacing one command waits all the while, so it waits no longer than above.
 */
const SILENCE_MS = 600;

/** Why no new command may be sent now, or that it may. */
export type GateState = "open" | "no_feedback" | "in_flight" | "rate" | "picture" | "sound";

export interface CommandGate {
  pacing: Pacing;
  tolerance: number; // events, of the picture; 4
  minIntervalMs: number; // between two events; 17
  calmIntervalMs: number; // not less; 40
  soundWaitMs: number; // 200
  event: number | null; // newest feedback; null before the first
  issue: number; // newest issue of that event
  nonce: number; // of that issue: a command names it, as proof that it was seen
  inFlight: number | null; // the event sent and not yet answered
  lastSentMs: number; // -Infinity before the first
  shown: number | null; // stamp of the picture on screen
  heard: AwaitedSound | null; // of several the one that is farthest behind; null: nothing is waited for
  sounds: Map<string, AwaitedSound>; // by microphone
}

/** A microphone that is heard. */
export interface HeardSound {
  readonly microphone: string;
  readonly segment: HeardSegment | null; // its newest; null: none
  readonly tolerance: number; // events
}

/** The next event and the issue of the feedback that it answers. */
export interface NextCommand {
  readonly event: number;
  readonly issue: number;
  readonly nonce: number; // of that issue
}

/**
 * The tolerance counts events, so each picture and each sound has less time where events follow one another quickly.
 * Events sooner than `calmIntervalMs` therefore wait while what is seen or heard is farther behind than two thirds of
 * its tolerance; as long as no picture was shown, they wait for none. A picture that is too old stays, veiled, until the
 * next comes; sound that is too old is gone. So an event that would make it too old waits for it, for `SOUND_WAIT_MS`.
 * A command that only lets go (`letsGo`: it is neutral) does not: the robot comes to rest as soon as without sound.
 */
export function createCommandGate(
  pacing: Pacing,
  tolerance: number,
  minIntervalMs: number,
  calmIntervalMs = minIntervalMs,
  holdMs = Infinity,
): CommandGate {
  return {
    pacing,
    tolerance,
    minIntervalMs,
    calmIntervalMs: Math.max(calmIntervalMs, minIntervalMs),
    soundWaitMs: Math.min(SOUND_WAIT_MS, holdMs / 2),
    event: null,
    issue: 0,
    nonce: 0,
    inFlight: null,
    lastSentMs: -Infinity,
    shown: null,
    heard: null,
    sounds: new Map(),
  };
}

/** The operator chose otherwise. */
export function setPacing(gate: CommandGate, pacing: Pacing, tolerance: number): void {
  gate.pacing = pacing;
  gate.tolerance = tolerance;
}

/** Takes a feedback; says whether it was news. */
export function takeFeedback(gate: CommandGate, event: number, issue: number, nonce = 0): boolean {
  if (gate.event === event) {
    if (issue <= gate.issue) return false;
    gate.issue = issue;
    gate.nonce = nonce;
    return true;
  }
  if (gate.event !== null && !isNewer(event, gate.event)) return false;
  gate.event = event;
  gate.issue = issue;
  gate.nonce = nonce;
  if (gate.inFlight !== null && !isNewer(gate.inFlight, event)) gate.inFlight = null;
  return true;
}

/** Takes a refusal; says whether it ended the flight. */
export function takeRefusal(gate: CommandGate, event: number): boolean {
  if (gate.inFlight !== event) return false;
  gate.inFlight = null;
  return true;
}

/** A new event was sent; repeats of it are not told. */
export function noteSent(gate: CommandGate, now: number): void {
  if (gate.event === null) return;
  gate.inFlight = eventAfter(gate.event);
  gate.lastSentMs = now;
}

/** A picture with this stamp is now on screen. */
export function noteShown(gate: CommandGate, stamp: number): void {
  gate.shown = stamp;
}

/** What is heard now. A microphone that is not among them, as when sound is off, is forgotten. */
export function noteHeard(gate: CommandGate, heard: readonly HeardSound[], now: number): void {
  const before = gate.sounds;
  const event = gate.event ?? 0;
  gate.sounds = new Map();
  gate.heard = null;
  const isMedia = gate.pacing === "media"; // then sound that stays at its tolerance would keep the gate shut
  const awaitedMs = isMedia ? gate.soundWaitMs : SILENCE_MS;
  for (const { microphone, segment, tolerance } of heard) {
    const known = before.get(microphone);
    const sound =
      segment === null ||
      gate.event === null ||
      (segment.atMs === known?.atMs && segment.stamp === known.stamp)
        ? known
        : hear(known, segment, event, tolerance, isMedia ? mostBehind(tolerance) : tolerance);
    if (sound === undefined) continue;
    gate.sounds.set(microphone, sound);
    if (!isAwaited(sound, awaitedMs, now)) continue;
    if (gate.heard === null || eventGap(event, sound.stamp) > eventGap(event, gate.heard.stamp))
      gate.heard = sound;
  }
}

export function gateState(gate: CommandGate, now: number, letsGo = false): GateState {
  if (gate.event === null) return "no_feedback";
  if (gate.inFlight !== null) return "in_flight";
  if (now < opensAt(gate, letsGo)) return "rate";
  if (gate.pacing !== "media") return "open";
  if (!isNear(gate.event, gate.shown, gate.tolerance)) return "picture";
  const { heard } = gate;
  return letsGo || heard === null || isNear(gate.event, heard.stamp, heard.tolerance) ? "open" : "sound";
}

/** When the event rate allows the next command, unless a picture or a sound comes before; -Infinity before the first. */
export function opensAt(gate: CommandGate, letsGo = false): number {
  return gate.lastSentMs + intervalMs(gate, letsGo);
}

function intervalMs(gate: CommandGate, letsGo: boolean): number {
  if (keepsUp(gate)) return gate.minIntervalMs;
  return losesSound(gate) && !letsGo ? Math.max(gate.soundWaitMs, gate.calmIntervalMs) : gate.calmIntervalMs;
}

/** Whether the next event would take what is heard out of its tolerance, and no rule but this one waits for it. */
function losesSound({ pacing, event, heard }: CommandGate): boolean {
  if (pacing === "media" || event === null || heard === null) return false;
  return eventGap(event, heard.stamp) > mostBehind(heard.tolerance);
}

function keepsUp({ event, shown, tolerance, heard }: CommandGate): boolean {
  if (event === null) return true;
  const isClose = (stamp: number, most: number): boolean =>
    Math.abs(eventGap(event, stamp)) <= Math.floor((2 * most) / 3);
  return (
    (shown === null || isClose(shown, tolerance)) && (heard === null || isClose(heard.stamp, heard.tolerance))
  );
}

export function nextCommand(gate: CommandGate): NextCommand | null {
  return gate.event === null ? null : { event: eventAfter(gate.event), issue: gate.issue, nonce: gate.nonce };
}

/**
 * Near enough to stay within tolerance when the next feedback comes, one event on. At tolerance 0 none is: there the
 * medium of the newest event must do.
 */
function isNear(event: number, stamp: number | null, tolerance: number): boolean {
  if (stamp === null) return false;
  const gap = eventGap(event, stamp);
  return -tolerance <= gap && gap <= mostBehind(tolerance);
}
