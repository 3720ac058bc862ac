/**
 * What a page does when its console falls silent: it asks whether the console can be reached at all, gives the old path
 * a moment to come back, then moves to another path by an ICE restart, and connects anew when that fails too.
 *
 * live → asking → hoping → restarting → moving → over; every message leads back to live.
 */
export type ReconnectPhase = "live" | "asking" | "hoping" | "restarting" | "moving" | "over";

/** What the shell has to do now. */
export type ReconnectAction = "ask" | "restart" | "reconnect";

export interface Reconnect {
  phase: ReconnectPhase;
  sinceMs: number; // when the phase began
  silentMs: number; // without a message, counted in steps: a page that was held up counts nothing
  stepMs: number | null; // the last step; null before the first
  askedMs: number; // the last question
  answerMs: number; // what the console's last answer took: one round trip of the path or a few
  alarmedUntilMs: number; // the network changed: silence counts sooner
}

const SILENT_MS = 1500; // pongs come once or twice a second, feedback twice a second at least
const ALARMED_MS = 700; // after a change of the network
const ALARM_MS = 5000;
const STEP_LIMIT_MS = 100; // a longer step is a page that was held up
const ASK_MS = 1000; // questions overlap: the first answer counts
const HOPE_MS = 400; // for the old path, once the console can be reached; and half of what its answer took
const MOST_HOPE_MS = 2000;
const MOVE_MS = 3000; // for the new path; and four times what the console's answer took
const MOST_MOVE_MS = 10_000;

export function createReconnect(): Reconnect {
  return {
    phase: "live",
    sinceMs: -Infinity,
    silentMs: 0,
    stepMs: null,
    askedMs: -Infinity,
    answerMs: 0,
    alarmedUntilMs: -Infinity,
  };
}

/** A message came. A restart that was asked for is carried to its end. */
export function reconnectHeard(reconnect: Reconnect, now: number): void {
  reconnect.silentMs = 0;
  if (reconnect.phase !== "over" && reconnect.phase !== "restarting") enter(reconnect, "live", now);
}

/** The network changed, or WebRTC misses the other side. */
export function reconnectAlarm(reconnect: Reconnect, now: number): void {
  reconnect.alarmedUntilMs = now + ALARM_MS;
}

/** To be called many times a second. */
export function reconnectStep(reconnect: Reconnect, now: number): ReconnectAction | null {
  reconnect.silentMs += Math.min(STEP_LIMIT_MS, now - (reconnect.stepMs ?? now));
  reconnect.stepMs = now;
  const spent = now - reconnect.sinceMs;
  switch (reconnect.phase) {
    case "live":
      if (reconnect.silentMs < (now < reconnect.alarmedUntilMs ? ALARMED_MS : SILENT_MS)) return null;
      enter(reconnect, "asking", now);
      return ask(reconnect, now);
    case "asking":
      return now - reconnect.askedMs < ASK_MS ? null : ask(reconnect, now);
    case "hoping":
      if (spent < Math.min(HOPE_MS + reconnect.answerMs / 2, MOST_HOPE_MS)) return null;
      enter(reconnect, "restarting", now);
      return "restart";
    case "moving":
      return spent < Math.min(MOVE_MS + 4 * reconnect.answerMs, MOST_MOVE_MS) ? null : giveUp(reconnect, now);
    case "restarting":
    case "over":
      return null;
  }
}

/** The console answered a question after `tookMs`, or something else did in its place. */
export function reconnectAsked(reconnect: Reconnect, reached: boolean, now: number, tookMs = 0): void {
  if (reached) reconnect.answerMs = tookMs;
  if (reconnect.phase === "asking" && reached) enter(reconnect, "hoping", now);
}

/** How the restart was answered. One that got no answer is asked for again, when the console can be reached. */
export function reconnectRestarted(
  reconnect: Reconnect,
  outcome: "accepted" | "refused" | "unanswered",
  now: number,
): ReconnectAction | null {
  if (reconnect.phase !== "restarting") return null;
  if (outcome === "refused") return giveUp(reconnect, now);
  enter(reconnect, outcome === "accepted" ? "moving" : "asking", now);
  return null;
}

function ask(reconnect: Reconnect, now: number): ReconnectAction {
  reconnect.askedMs = now;
  return "ask";
}

function giveUp(reconnect: Reconnect, now: number): ReconnectAction {
  enter(reconnect, "over", now);
  return "reconnect";
}

function enter(reconnect: Reconnect, phase: ReconnectPhase, now: number): void {
  reconnect.phase = phase;
  reconnect.sinceMs = now;
}

/** What the page does about a console that fell silent. */
export function reconnectLabel(phase: ReconnectPhase): string {
  switch (phase) {
    case "live":
    case "asking":
      return "Checking whether the console can be reached.";
    case "hoping":
      return "The console can be reached: waiting for this connection to come back.";
    case "restarting":
    case "moving":
      return "The console can be reached: moving this connection to another path.";
    case "over":
      return "Connecting again.";
  }
}
