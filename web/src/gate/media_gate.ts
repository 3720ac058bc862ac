import { eventGap } from "./serial";

export type Verdict = "render" | "discard" | "hold";

/** `event` is the rule; `off` renders everything. */
export type GateMode = "event" | "off";

/** What the gate says of one picture or sound segment. */
export interface Judgement {
  readonly verdict: Verdict;
  readonly gap: number | null; // feedback - stamp; null while either is unknown
}

/**
 * The media gate: one rule for pictures and sound (docs/architecture.md, "The gate").
 * `feedback` and `stamp` are null while unknown.
 */
export function judge(
  feedback: number | null,
  stamp: number | null,
  tolerance: number,
  mode: GateMode,
): Judgement {
  const gap = feedback === null || stamp === null ? null : eventGap(feedback, stamp);
  return { verdict: verdictOf(mode, stamp, gap, tolerance), gap };
}

function verdictOf(mode: GateMode, stamp: number | null, gap: number | null, tolerance: number): Verdict {
  if (mode === "off") return "render";
  if (stamp === null) return "discard";
  if (gap === null) return "hold";
  if (gap > tolerance) return "discard";
  return gap < -tolerance ? "hold" : "render";
}
