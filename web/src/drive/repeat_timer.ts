/** When the pending command is sent again (RFC 6298 2; Karn's rule is the caller's). */

export const INITIAL_MS = 100; // before the first sample
const FLOOR_MS = 20;
const CAP_MS = 500;
const GRANULARITY_MS = 10;

export interface RepeatTimer {
  smoothedMs: number | null; // SRTT; null before the first sample
  variationMs: number; // RTTVAR
}

export function createRepeatTimer(): RepeatTimer {
  return { smoothedMs: null, variationMs: 0 };
}

/** Takes one measured command-to-feedback time. */
export function takeSample(timer: RepeatTimer, sampleMs: number): void {
  if (timer.smoothedMs === null) {
    timer.smoothedMs = sampleMs;
    timer.variationMs = sampleMs / 2;
    return;
  }
  timer.variationMs = 0.75 * timer.variationMs + 0.25 * Math.abs(timer.smoothedMs - sampleMs);
  timer.smoothedMs = 0.875 * timer.smoothedMs + 0.125 * sampleMs;
}

export function repeatInterval(timer: RepeatTimer): number {
  if (timer.smoothedMs === null) return INITIAL_MS;
  const interval = timer.smoothedMs + Math.max(GRANULARITY_MS, 4 * timer.variationMs);
  return Math.min(CAP_MS, Math.max(FLOOR_MS, interval));
}

/** How long to wait for the first answer where losses are expected: shorter, and wrong now and then. */
export function earlyInterval(timer: RepeatTimer): number {
  if (timer.smoothedMs === null) return INITIAL_MS;
  return Math.min(CAP_MS, Math.max(FLOOR_MS, timer.smoothedMs + Math.max(GRANULARITY_MS, timer.variationMs)));
}

/** How long to wait after the `sends`-th send of one event: the interval twice, then doubling up to the cap. */
export function waitAfter(timer: RepeatTimer, sends: number): number {
  return Math.min(CAP_MS, repeatInterval(timer) * 2 ** Math.max(0, sends - 2));
}
