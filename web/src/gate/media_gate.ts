import { eventGap } from "./serial";

export type Verdict = "render" | "discard" | "hold";

/** `event` is the rule. What it is compared with: `off` renders everything, `age` goes by synchronised clocks. */
export type GateMode = "event" | "off" | "age";

/** Of the mode `age`. */
export const MAX_AGE_MS = 500;

/** What the gate says of one picture or sound segment. */
export interface Judgement {
  readonly verdict: Verdict;
  readonly gap: number | null; // feedback - stamp; null while either is unknown
}

/**
 * The media gate: one rule for pictures and sound (docs/architecture.md, "The gate").
 * `feedback` and `stamp` are null while unknown; `ageMs`, for the mode `age` alone, when the medium does not say.
 */
export function judge(
  feedback: number | null,
  stamp: number | null,
  tolerance: number,
  mode: GateMode,
  ageMs: number | null,
): Judgement {
  const gap = feedback === null || stamp === null ? null : eventGap(feedback, stamp);
  return { verdict: verdictOf(mode, stamp, gap, tolerance, ageMs), gap };
}

function verdictOf(
  mode: GateMode,
  stamp: number | null,
  gap: number | null,
  tolerance: number,
  ageMs: number | null,
): Verdict {
  if (mode === "off") return "render";
  if (mode === "age") return ageMs !== null && ageMs <= MAX_AGE_MS ? "render" : "discard";
  if (stamp === null) return "discard";
  if (gap === null) return "hold";
  if (gap > tolerance) return "discard";
  return gap < -tolerance ? "hold" : "render";
}
