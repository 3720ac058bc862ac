import type { FleetRobot, StopReply } from "./fleet_answer";
import { robotsWords } from "./fleet_order";

const REPEAT_MS = 1000;
const GIVE_UP_MS = 10_000;

/** What became of a STOP at one robot. `told`: delivered, but the robot does not report it yet. */
export type StopFate = "stopped" | "told" | "kept" | "asking";

/** One press of STOP ALL, until every robot reports that it is stopped or nobody waits any more. */
export interface StopAll {
  pressedMs: number | null; // null: never pressed, or its answer was put away
  isOver: boolean; // nothing is repeated any more
  nextMs: number; // when it is said again
  answered: boolean; // by the console, at least once
  failure: string; // why the last try got no answer
  readonly fates: Map<string, { fate: StopFate; detail: string }>;
}

export function createStopAll(): StopAll {
  return { pressedMs: null, isOver: true, nextMs: 0, answered: false, failure: "", fates: new Map() };
}

/** Takes effect at once, also while an earlier press is not confirmed yet. `names`: all that the page knows. */
export function pressStopAll(stop: StopAll, names: readonly string[], now: number): void {
  stop.pressedMs = now;
  stop.isOver = false;
  stop.nextMs = now;
  stop.answered = false;
  stop.failure = "";
  stop.fates.clear();
  for (const name of names) stop.fates.set(name, { fate: "asking", detail: "" });
}

/** Whether to say it now. */
export function stepStopAll(stop: StopAll, now: number): boolean {
  if (stop.pressedMs === null || stop.isOver) return false;
  const fates = [...stop.fates.values()];
  if (stop.answered && fates.every(({ fate }) => fate === "stopped")) stop.isOver = true;
  else if (now - stop.pressedMs > GIVE_UP_MS) stop.isOver = true;
  if (stop.isOver || now < stop.nextMs) return false;
  stop.nextMs = now + REPEAT_MS;
  return true;
}

/** An answer to one try, by whatever way. What a robot reported since stays; what one way delivered is delivered. */
export function tookStopReplies(stop: StopAll, replies: readonly StopReply[]): void {
  if (stop.pressedMs === null) return;
  stop.answered = true;
  stop.failure = "";
  for (const { name, delivered, detail } of replies) {
    const known = stop.fates.get(name)?.fate;
    if (known === "stopped" || (known === "told" && !delivered)) continue;
    stop.fates.set(name, { fate: delivered ? "told" : "kept", detail });
  }
}

export function stopFailed(stop: StopAll, why: string): void {
  stop.failure = why;
}

/** News of the robots that were asked for at `askedMs`: only what is newer than the press confirms it. */
export function tookFleet(stop: StopAll, robots: readonly FleetRobot[], askedMs: number): void {
  if (stop.pressedMs === null || stop.isOver || askedMs < stop.pressedMs) return;
  for (const robot of robots) {
    if (robot.link === "up" && robot.stopped) stop.fates.set(robot.name, { fate: "stopped", detail: "" });
    else if (!stop.fates.has(robot.name)) stop.fates.set(robot.name, { fate: "asking", detail: "" });
  }
}

/** The answer is read. */
export function putAway(stop: StopAll): void {
  stop.pressedMs = null;
  stop.isOver = true;
}

export interface StopWords {
  readonly tone: "pending" | "done" | "bad";
  readonly title: string;
  readonly stopped: readonly string[]; // names
  readonly missing: readonly { readonly name: string; readonly detail: string }[];
  readonly advice: string; // what to do
}

/** What to show of it; null when there is nothing. */
export function stopAllWords(stop: StopAll): StopWords | null {
  if (stop.pressedMs === null) return null;
  const all = [...stop.fates];
  const stopped = all.filter(([, { fate }]) => fate === "stopped").map(([name]) => name);
  const missing = all
    .filter(([, { fate }]) => fate !== "stopped")
    .map(([name, { fate, detail }]) => ({ name, detail: fateWords(fate, detail) }));
  const words = { stopped, missing };
  if (!stop.answered && stop.isOver && stopped.length === 0)
    return { tone: "bad", title: "STOP is not confirmed", ...words, advice: unansweredWords(stop.failure) };
  if (missing.length === 0 && stop.answered)
    return {
      tone: "done",
      title: all.length === 1 ? "The robot is stopped" : `All ${robotsWords(all.length)} are stopped`,
      ...words,
      advice:
        all.length === 0
          ? "This link is good for no robot."
          : "Each is reset on its own page. A reset moves nothing.",
    };
  const counted = `${stopped.length} of ${robotsWords(all.length)} stopped`;
  const isKept = all.some(([, { fate }]) => fate === "kept");
  if (!stop.isOver && !isKept) {
    const advice = stop.failure === "" ? "" : `${stop.failure} It is said again.`;
    return { tone: "pending", title: all.length === 0 ? "Saying STOP …" : `${counted} …`, ...words, advice };
  }
  return {
    tone: "bad",
    title: counted,
    ...words,
    advice: `${stop.failure === "" ? "" : `${stop.failure} `}Stop the others by their own emergency stops. Press again to say it once more.`,
  };
}

function fateWords(fate: StopFate, detail: string): string {
  if (fate === "asking") return "not answered yet";
  if (fate === "told") return "delivered, not confirmed by the robot";
  return detail === ""
    ? "not delivered: it is kept and sent first when the robot is back"
    : `not delivered: ${detail}`;
}

function unansweredWords(failure: string): string {
  return `${failure === "" ? "" : `${failure} `}Press again, and stop the robots by their own emergency stops.`;
}
