import type { FleetStatus } from "./fleet_status";
import { STALE_MS } from "../drive/feedback_age";
import type { ConnectionEnd, ConnectionErrorKind } from "../transport/connection_error";

/** Polls come once a second, and one may be slow. */
export const UNKNOWN_MS = 2 * STALE_MS;

/** Why the console does not tell; `ended` is for good. */
export type PollError = { readonly why: ConnectionErrorKind } | { readonly ended: ConnectionEnd };

/** What this page knows of the fleet, and since when. */
export interface PollState {
  answer: FleetStatus | null; // the newest; null before the first
  askedMs: number; // when that one was asked for; -Infinity before
  heardMs: number; // when it came
  heardAt: number; // the same, ms since 1970: for people
  trouble: PollError | null; // of the newest attempt
}

export type PollPhase = "loading" | "live" | "unknown" | "shut_out";

export function createPollState(): PollState {
  return { answer: null, askedMs: -Infinity, heardMs: -Infinity, heardAt: 0, trouble: null };
}

export function tookAnswer(
  poll: PollState,
  answer: FleetStatus,
  askedMs: number,
  now: number,
  wall: number,
): void {
  poll.answer = answer;
  poll.askedMs = askedMs;
  poll.heardMs = now;
  poll.heardAt = wall;
  poll.trouble = null;
}

/** The console did not tell. A link that is good for nothing any more shows nothing any more. */
export function tookError(poll: PollState, trouble: PollError): void {
  poll.trouble = trouble;
  if (isShutOut(trouble)) poll.answer = null;
}

/** `unknown`: what is shown was so once. */
export function pollPhase(poll: PollState, now: number): PollPhase {
  if (poll.trouble !== null && isShutOut(poll.trouble)) return "shut_out";
  if (poll.answer === null) return "loading";
  return now - poll.heardMs < UNKNOWN_MS ? "live" : "unknown";
}

/** "12:03:20" */
export function clockLabel(wall: number): string {
  return new Date(wall).toTimeString().slice(0, 8);
}

function isShutOut(trouble: PollError): boolean {
  return "ended" in trouble || trouble.why === "token_refused" || trouble.why === "origin_refused";
}
