import type { ResumePhase } from "./resume";

/** A bridge measures at least twice a second, and the console says something as often. */
export const STALE_MS = 1500;

/** How old what was measured is, once that is too old to be taken for the present; null while it is not. */
export function staleAge(measuredMs: number | null, now: number): string | null {
  const ageMs = measuredMs === null ? 0 : now - measuredMs;
  return ageMs < STALE_MS ? null : ageWords(ageMs);
}

/** "3 s", "2 min" */
export function ageWords(ageMs: number): string {
  const seconds = Math.floor(ageMs / 1000);
  return seconds < 100 ? `${seconds} s` : `${Math.floor(seconds / 60)} min`;
}

/** What the page does about a console that fell silent. */
export function resumeWords(phase: ResumePhase): string {
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
