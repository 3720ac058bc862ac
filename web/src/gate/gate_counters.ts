import type { GateMode } from "./media_gate";

/** What the gate did with one stream. */
export interface GateCounters {
  stamp: number | null; // newest seen
  gap: number | null; // of the newest rendering; of sound, also while it is off
  maxGap: number; // largest |gap| rendered
  gapSum: number; // of |gap| rendered
  gapsKnown: number; // renderings with a gap
  lag: number; // largest gap seen since the last report, rendered or not
  received: number; // put to the gate
  rendered: number;
  discarded: number;
  held: number;
  violations: number; // rendered with |gap| > tolerance; 0 unless the gate is off
}

/** What the gate judges against. */
export interface GateContext {
  readonly feedback: number | null; // newest event
  readonly tolerance: number; // of this kind of medium
  readonly gate: GateMode;
  readonly wallMs: number; // since 1970, for the age of what is rendered
}

/** What sound is judged against, also away from the page, where nobody asks for its age. */
export type SoundContext = Omit<GateContext, "wallMs">;

/** What is known of one received frame. */
export interface FrameMark {
  readonly stamp: number | null; // null: it came without one
  readonly capturedMs: number | null; // since 1970 on the sender's clock; null: it does not say
}

export const UNMARKED: FrameMark = { stamp: null, capturedMs: null };

export function createGateCounters(): GateCounters {
  return {
    stamp: null,
    gap: null,
    maxGap: 0,
    gapSum: 0,
    gapsKnown: 0,
    lag: 0,
    received: 0,
    rendered: 0,
    discarded: 0,
    held: 0,
    violations: 0,
  };
}

/** Since the capture, by synchronised clocks; null when the frame does not say. */
export function ageOf(mark: FrameMark, context: GateContext): number | null {
  return mark.capturedMs === null ? null : context.wallMs - mark.capturedMs;
}

/** A medium came with this gap, whatever becomes of it. */
export function noteSeen(counts: GateCounters, gap: number | null): void {
  if (gap !== null) counts.lag = Math.max(counts.lag, gap);
}

/** The lag for a report; the next one begins anew. */
export function takeLag(counts: GateCounters): number {
  const { lag } = counts;
  counts.lag = 0;
  return lag;
}

/** Mean |gap| of what was rendered; null before the first gap is known. */
export function meanGap(counts: GateCounters): number | null {
  return counts.gapsKnown === 0 ? null : counts.gapSum / counts.gapsKnown;
}

/** Books a rendering, and checks the rule again apart from the gate. */
export function noteRendered(counts: GateCounters, gap: number | null, context: GateContext): void {
  counts.rendered += 1;
  counts.gap = gap;
  if (gap === null) {
    if (context.gate === "event") counts.violations += 1;
    return;
  }
  const size = Math.abs(gap);
  counts.maxGap = Math.max(counts.maxGap, size);
  counts.gapSum += size;
  counts.gapsKnown += 1;
  if (size > context.tolerance) counts.violations += 1;
}
