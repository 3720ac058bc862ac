import type { FleetAnswer } from "./fleet_answer";
import { STALE_MS } from "./freshness";
import type { LinkEnd, LinkTrouble } from "./trouble";

/** Polls come once a second, and one may be slow. */
export const UNKNOWN_MS = 2 * STALE_MS;

/** Why the console does not tell; `ended` is for good. */
export type FleetTrouble = { readonly why: LinkTrouble } | { readonly ended: LinkEnd };

/** What this page knows of the fleet, and since when. */
export interface FleetNews {
  answer: FleetAnswer | null; // the newest; null before the first
  askedMs: number; // when that one was asked for; -Infinity before
  heardMs: number; // when it came
  heardAt: number; // the same, ms since 1970: for people
  trouble: FleetTrouble | null; // of the newest attempt
}

export type FleetPhase = "loading" | "live" | "unknown" | "shut_out";

export function createFleetNews(): FleetNews {
  return { answer: null, askedMs: -Infinity, heardMs: -Infinity, heardAt: 0, trouble: null };
}

export function tookAnswer(
  news: FleetNews,
  answer: FleetAnswer,
  askedMs: number,
  now: number,
  wall: number,
): void {
  news.answer = answer;
  news.askedMs = askedMs;
  news.heardMs = now;
  news.heardAt = wall;
  news.trouble = null;
}

/** The console did not tell. A link that is good for nothing any more shows nothing any more. */
export function tookTrouble(news: FleetNews, trouble: FleetTrouble): void {
  news.trouble = trouble;
  if (isShutOut(trouble)) news.answer = null;
}

/** `unknown`: what is shown was so once. */
export function fleetPhase(news: FleetNews, now: number): FleetPhase {
  if (news.trouble !== null && isShutOut(news.trouble)) return "shut_out";
  if (news.answer === null) return "loading";
  return now - news.heardMs < UNKNOWN_MS ? "live" : "unknown";
}

/** "12:03:20" */
export function clockWords(wall: number): string {
  return new Date(wall).toTimeString().slice(0, 8);
}

function isShutOut(trouble: FleetTrouble): boolean {
  return "ended" in trouble || trouble.why === "token_refused" || trouble.why === "origin_refused";
}
