import type { FleetRobot, StopReply } from "./fleet_status";
import { robotsLabel } from "./robot_order";

const REPEAT_MS = 1000;
const DOUBT_AFTER_MS = 3000;
const GIVE_UP_MS = 60_000;

/**
 * What became of a press at one robot. `stopped`: that robot confirmed this press, `unsaved`: it has, and its disk has not;
 * `kept`: it was not delivered, and the console keeps it.
 */
export type StopFate = "stopped" | "unsaved" | "kept" | "asking";

/** One press of STOP ALL, until every robot has confirmed it or nobody waits any more. */
export interface StopAll {
  press: string; // its id, which every way to every robot carries
  pressedMs: number | null; // null: never pressed, or its answer was put away
  isOver: boolean; // nothing is repeated any more
  isDoubtful: boolean; // some robot has not confirmed it for too long
  nextMs: number; // when it is said again
  answered: boolean; // by the console, at least once
  failure: string; // why the last try got no answer
  readonly fates: Map<string, { fate: StopFate; detail: string }>;
}

export function createStopAll(): StopAll {
  return {
    press: "",
    pressedMs: null,
    isOver: true,
    isDoubtful: false,
    nextMs: 0,
    answered: false,
    failure: "",
    fates: new Map(),
  };
}

/** Takes effect at once, also while an earlier press is not confirmed yet. `names`: all that the page knows. */
export function pressStopAll(stop: StopAll, press: string, names: readonly string[], now: number): void {
  stop.press = press;
  stop.pressedMs = now;
  stop.isOver = stop.isDoubtful = false;
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
  if (stop.answered && fates.every(({ fate }) => isStopped(fate))) stop.isOver = true;
  else if (now - stop.pressedMs > GIVE_UP_MS) stop.isOver = true;
  else if (now - stop.pressedMs > DOUBT_AFTER_MS) stop.isDoubtful = true;
  if (stop.isOver || now < stop.nextMs) return false;
  stop.nextMs = now + REPEAT_MS;
  return true;
}

/** An answer about this press, by whatever way. What one way has confirmed stays confirmed. */
export function tookStopReplies(stop: StopAll, press: string, replies: readonly StopReply[]): void {
  if (stop.pressedMs === null || stop.press !== press) return;
  stop.answered = true;
  stop.failure = "";
  for (const { name, delivered, kept, detail } of replies) {
    const known = stop.fates.get(name)?.fate;
    if (known === "stopped" || (known === "unsaved" && !(delivered && kept))) continue;
    stop.fates.set(name, { fate: delivered ? (kept ? "stopped" : "unsaved") : "kept", detail });
  }
}

function isStopped(fate: StopFate): boolean {
  return fate === "stopped" || fate === "unsaved";
}

export function stopFailed(stop: StopAll, press: string, why: string): void {
  if (stop.press === press) stop.failure = why;
}

/** Robots that the page did not know when it was pressed. That one of them is stopped confirms no press. */
export function tookFleet(stop: StopAll, robots: readonly FleetRobot[]): void {
  if (stop.pressedMs === null || stop.isOver) return;
  for (const { name } of robots)
    if (!stop.fates.has(name)) stop.fates.set(name, { fate: "asking", detail: "" });
}

/** The answer is read. */
export function putAway(stop: StopAll): void {
  stop.pressedMs = null;
  stop.isOver = true;
}

export interface StopAllLabels {
  readonly tone: "pending" | "done" | "bad";
  readonly title: string;
  readonly stopped: readonly string[]; // names
  readonly missing: readonly { readonly name: string; readonly detail: string }[];
  readonly unsaved: readonly string[]; // names, of those that are stopped
  readonly advice: string; // what to do
}

/** What to show of it; null when there is nothing. */
export function stopAllLabels(stop: StopAll): StopAllLabels | null {
  if (stop.pressedMs === null) return null;
  const all = [...stop.fates];
  const stopped = all.filter(([, { fate }]) => isStopped(fate)).map(([name]) => name);
  const unsaved = all.filter(([, { fate }]) => fate === "unsaved").map(([name]) => name);
  const missing = all
    .filter(([, { fate }]) => !isStopped(fate))
    .map(([name, { fate, detail }]) => ({ name, detail: fateWords(fate, detail) }));
  const words = { stopped, missing, unsaved };
  const isLate = stop.isOver || stop.isDoubtful;
  if (!stop.answered && isLate && stopped.length === 0)
    return { tone: "bad", title: "STOP is not confirmed", ...words, advice: unansweredWords(stop) };
  if (missing.length === 0 && stop.answered)
    return {
      tone: unsaved.length === 0 ? "done" : "bad",
      title: `${all.length === 1 ? "The robot is stopped" : `All ${robotsLabel(all.length)} are stopped`}${notSavedWords(unsaved.length, all.length)}`,
      ...words,
      advice:
        all.length === 0
          ? "This link admits to no robot."
          : unsaved.length > 0
            ? UNSAVED_ADVICE
            : "Reset each robot on its own page. A reset moves nothing.",
    };
  const counted = `${stopped.length} of ${robotsLabel(all.length)} stopped`;
  const isKept = all.some(([, { fate }]) => fate === "kept");
  if (!isLate && !isKept) {
    const advice = stop.failure === "" ? "" : `${stop.failure} The page sends STOP again.`;
    return { tone: "pending", title: all.length === 0 ? "Sending STOP …" : `${counted} …`, ...words, advice };
  }
  return {
    tone: "bad",
    title: counted,
    ...words,
    advice: `${stop.failure === "" ? "" : `${stop.failure} `}Stop the others with their own emergency stops. ${nextWords(stop)}${unsaved.length > 0 ? ` ${UNSAVED_ADVICE}` : ""}`,
  };
}

function notSavedWords(unsaved: number, all: number): string {
  if (unsaved === 0) return "";
  return unsaved === all ? ", NOT SAVED" : `, ${unsaved} NOT SAVED`;
}

const UNSAVED_ADVICE =
  "A robot that has not saved its stop may move again when it restarts. Switch it off with its hardware stop.";

function fateWords(fate: StopFate, detail: string): string {
  if (fate === "asking") return "not answered yet";
  return detail === ""
    ? "not delivered: the stop is kept and sent first when the robot is back"
    : `not delivered: ${detail}`;
}

function nextWords(stop: StopAll): string {
  return stop.isOver ? "Press STOP ALL to send it again." : "The page sends STOP again every second.";
}

function unansweredWords(stop: StopAll): string {
  return `${stop.failure === "" ? "" : `${stop.failure} `}Stop the robots with their own emergency stops. ${nextWords(stop)}`;
}
