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
export function reconnectHeard(resume: Reconnect, now: number): void {
  resume.silentMs = 0;
  if (resume.phase !== "over" && resume.phase !== "restarting") enter(resume, "live", now);
}

/** The network changed, or WebRTC misses the other side. */
export function reconnectAlarm(resume: Reconnect, now: number): void {
  resume.alarmedUntilMs = now + ALARM_MS;
}

/** To be called many times a second. */
export function reconnectStep(resume: Reconnect, now: number): ReconnectAction | null {
  resume.silentMs += Math.min(STEP_LIMIT_MS, now - (resume.stepMs ?? now));
  resume.stepMs = now;
  const spent = now - resume.sinceMs;
  switch (resume.phase) {
    case "live":
      if (resume.silentMs < (now < resume.alarmedUntilMs ? ALARMED_MS : SILENT_MS)) return null;
      enter(resume, "asking", now);
      return ask(resume, now);
    case "asking":
      return now - resume.askedMs < ASK_MS ? null : ask(resume, now);
    case "hoping":
      if (spent < Math.min(HOPE_MS + resume.answerMs / 2, MOST_HOPE_MS)) return null;
      enter(resume, "restarting", now);
      return "restart";
    case "moving":
      return spent < Math.min(MOVE_MS + 4 * resume.answerMs, MOST_MOVE_MS) ? null : giveUp(resume, now);
    case "restarting":
    case "over":
      return null;
  }
}

/** The console answered a question after `tookMs`, or something else did in its place. */
export function reconnectAsked(resume: Reconnect, reached: boolean, now: number, tookMs = 0): void {
  if (reached) resume.answerMs = tookMs;
  if (resume.phase === "asking" && reached) enter(resume, "hoping", now);
}

/** How the restart was answered. One that got no answer is asked for again, when the console can be reached. */
export function reconnectRestarted(
  resume: Reconnect,
  outcome: "accepted" | "refused" | "unanswered",
  now: number,
): ReconnectAction | null {
  if (resume.phase !== "restarting") return null;
  if (outcome === "refused") return giveUp(resume, now);
  enter(resume, outcome === "accepted" ? "moving" : "asking", now);
  return null;
}

function ask(resume: Reconnect, now: number): ReconnectAction {
  resume.askedMs = now;
  return "ask";
}

function giveUp(resume: Reconnect, now: number): ReconnectAction {
  enter(resume, "over", now);
  return "reconnect";
}

function enter(resume: Reconnect, phase: ReconnectPhase, now: number): void {
  resume.phase = phase;
  resume.sinceMs = now;
}

/** What the page does about a console that fell silent. */
export function reconnectLabel(phase: ReconnectPhase): string {
  switch (phase) {
    case "live":
    case "asking":
      return "Asking whether it can be reached.";
    case "hoping":
      return "It can be reached: waiting for this connection to come back.";
    case "restarting":
    case "moving":
      return "It can be reached: moving this connection to another path.";
    case "over":
      return "Connecting anew.";
  }
}
