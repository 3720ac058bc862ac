/** What the gate did with one stream. */
export interface MediumCounts {
  stamp: number | null; // newest seen
  gap: number | null; // of the newest rendering; of sound, also while it is off
  maxGap: number; // largest |gap| rendered
  rendered: number;
  discarded: number;
  held: number;
  violations: number; // rendered against the rule; stays 0
}

/** What the gate judges against. */
export interface GateContext {
  readonly feedback: number | null; // newest event
  readonly tolerance: number; // of this kind of medium
  readonly enabled: boolean;
}

export function createCounts(): MediumCounts {
  return { stamp: null, gap: null, maxGap: 0, rendered: 0, discarded: 0, held: 0, violations: 0 };
}

/** Books a rendering, and checks the rule again apart from the gate. */
export function noteRendered(counts: MediumCounts, gap: number | null, context: GateContext): void {
  counts.rendered += 1;
  counts.gap = gap;
  if (gap !== null) counts.maxGap = Math.max(counts.maxGap, Math.abs(gap));
  if (context.enabled && (gap === null || Math.abs(gap) > context.tolerance)) counts.violations += 1;
}
