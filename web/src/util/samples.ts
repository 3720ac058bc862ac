/** The newest `limit` measurements and their quantiles. */
export interface Samples {
  readonly limit: number; // 500
  readonly values: number[];
}

export function createSamples(limit: number): Samples {
  return { limit, values: [] };
}

export function addSample(samples: Samples, value: number): void {
  samples.values.push(value);
  if (samples.values.length > samples.limit) samples.values.shift();
}

/** The `fraction` quantile (nearest rank), null without samples. */
export function quantile(samples: Samples, fraction: number): number | null {
  const sorted = samples.values.toSorted((left, right) => left - right);
  return sorted[Math.max(0, Math.ceil(fraction * sorted.length) - 1)] ?? null;
}

/** Times of the newest happenings, for a rate per second. */
export interface RateMeter {
  readonly windowMs: number; // 2000
  readonly times: number[];
}

export function createRateMeter(windowMs = 2000): RateMeter {
  return { windowMs, times: [] };
}

export function noteOccurrence(meter: RateMeter, now: number): void {
  meter.times.push(now);
  dropOld(meter, now);
}

export function rateOf(meter: RateMeter, now: number): number {
  dropOld(meter, now);
  return (meter.times.length * 1000) / meter.windowMs;
}

function dropOld(meter: RateMeter, now: number): void {
  while ((meter.times[0] ?? now) < now - meter.windowMs) meter.times.shift();
}
