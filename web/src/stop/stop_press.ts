import type { StopState, StopTaken } from "../protocol/wire";

const REPEAT_MS = 250;
const SLOW_AFTER_MS = 10_000; // then it is said once a second
const SLOW_REPEAT_MS = 1000;
const HTTP_REPEAT_MS = 1000;
const DOUBT_AFTER_MS = 2000;
const GIVE_UP_MS = 60_000;
const SAVE_MS = 1000; // that the robot's disk may take until a stop counts as not kept

/**
 * What became of a press. `confirmed`: the robot has it on its disk. `not_kept`: the robot has it, its disk has not.
 * `waiting`: the console keeps it until the robot link is back. `unconfirmed`: nobody has said anything for too long.
 */
export type StopFate = "sending" | "confirmed" | "not_kept" | "waiting" | "unconfirmed" | "silenced";

/** What the console's answer over HTTP says of a press. */
export type StopAnswer =
  | { readonly kind: "taken"; readonly number: number; readonly kept: boolean }
  | { readonly kind: "waiting" | "doubtful" | "silenced" | "unknown" };

/** One press of STOP. All its repeats, on every way, carry its id, so that they are one stop. */
export interface StopPress {
  readonly id: string; // 32 hex digits
  readonly reason: string; // "stop key"
  readonly sinceMs: number;
  nextMs: number; // when it is said again
  nextHttpMs: number;
  number: number | null; // of the stop that it became; null while nobody has confirmed it
  unkeptMs: number | null; // since when a confirmed one is known not to be on the robot's disk; null: it is
  heard: "nothing" | "waiting" | "doubtful" | "silenced"; // from the console, of one that is not confirmed
}

/** `random`: 16 bytes that nobody else draws. */
export function pressId(random: Uint8Array): string {
  return [...random].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

export function createPress(random: Uint8Array, reason: string, now: number): StopPress {
  const id = pressId(random);
  return {
    id,
    reason,
    sinceMs: now,
    nextMs: now,
    nextHttpMs: now,
    number: null,
    unkeptMs: null,
    heard: "nothing",
  };
}

/** The bridge's own answer. That to another press, also of the same person, confirms nothing. */
export function tookStopTaken(press: StopPress, taken: Pick<StopTaken, "press" | "number" | "kept">): void {
  if (taken.press !== press.id) return;
  press.number = taken.number;
  press.unkeptMs = taken.kept ? null : -Infinity; // the robot has tried
}

/** A stop that held before, or somebody else's, confirms nothing. */
export function tookStopState(press: StopPress, stop: StopState, now: number): void {
  if (stop.press === press.id) press.number = stop.number;
  if (press.number !== null && stop.number >= press.number)
    press.unkeptMs = unkeptSince(press.unkeptMs, stop, now);
}

/** Since when a stop is not on the robot's disk, with this state: a robot says so too while it still writes. */
export function unkeptSince(before: number | null, stop: StopState, now: number): number | null {
  return stop.kept ? null : (before ?? now);
}

/** Whether that is for so long that the disk takes nothing. */
export function isUnkept(unkeptMs: number | null, now: number): boolean {
  return unkeptMs !== null && now - unkeptMs >= SAVE_MS;
}

export function tookStopAnswer(press: StopPress, answer: StopAnswer): void {
  if (answer.kind === "taken") tookStopTaken(press, { ...answer, press: press.id });
  else if (answer.kind !== "unknown") press.heard = answer.kind;
}

export function stopFate(press: StopPress, now: number): StopFate {
  if (press.number !== null) return isUnkept(press.unkeptMs, now) ? "not_kept" : "confirmed";
  if (press.heard === "silenced" || press.heard === "waiting") return press.heard;
  return press.heard === "doubtful" || now - press.sinceMs > DOUBT_AFTER_MS ? "unconfirmed" : "sending";
}

/**
 * Whether it is still said. One that the console keeps is said until the robot has it, however long that takes: nobody
 * else would tell a page that has a new connection by then what became of it.
 */
export function isBeingSaid(press: StopPress, now: number): boolean {
  if (press.number !== null || press.heard === "silenced") return false;
  return press.heard === "waiting" || now - press.sinceMs <= GIVE_UP_MS;
}

/** Whether the robot may have to be taken for stopped although it does not say so yet. */
export function outranks(press: StopPress, stop: StopState, now: number): boolean {
  return press.number === null ? isBeingSaid(press, now) : press.number > stop.number;
}

/** Whether it was confirmed and somebody has reset it since: nothing is left to tell of it. */
export function isPast(press: StopPress, stop: StopState): boolean {
  return press.number !== null && !stop.stopped && stop.number >= press.number;
}

/** On which ways to say it now. */
export function stopDue(press: StopPress, now: number): { channels: boolean; http: boolean } {
  if (!isBeingSaid(press, now)) return { channels: false, http: false };
  const channels = now >= press.nextMs;
  const http = now >= press.nextHttpMs;
  if (channels) press.nextMs = now + (now - press.sinceMs > SLOW_AFTER_MS ? SLOW_REPEAT_MS : REPEAT_MS);
  if (http) press.nextHttpMs = now + HTTP_REPEAT_MS;
  return { channels, http };
}
