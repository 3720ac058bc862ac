/** The scale of a chart whose values lie between `low` and `high`; null when it shows none. */
export function valueRange(low: number | null, high: number | null, fromZero: boolean): [number, number] {
  if (low === null || high === null) return [0, 1];
  if (fromZero) return [Math.min(0, low), Math.max(1, high * 1.08)];
  const margin = Math.max(1, (high - low) * 0.06);
  return [low - margin, high + margin];
}

/** The scale of gaps: both ways from 0, with room around the tolerance, which is among the values. */
export function gapRange(low: number | null, high: number | null): [number, number] {
  if (low === null || high === null) return [-1, 1];
  return [low - Math.max(1, -low * 0.15), high + Math.max(1, high * 0.15)];
}

/** How often charts of this many seconds are drawn anew: no oftener than they visibly change. */
export function redrawMs(seconds: number): number {
  return seconds <= 30 ? 200 : seconds <= 120 ? 500 : 1000;
}

/** Carries each value over at most `rows` holes: a slow camera does not render in every row. */
export function held(values: readonly (number | null)[], rows: number): (number | null)[] {
  let last: number | null = null;
  let age = 0;
  return values.map((value) => {
    age = value === null ? age + 1 : 0;
    last = value ?? (age > rows ? null : last);
    return last;
  });
}
