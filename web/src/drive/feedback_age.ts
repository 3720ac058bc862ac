/** A bridge measures at least twice a second, and the console says something as often. */
export const STALE_MS = 1500;

/** How old what was measured is, once that is too old to be taken for the present; null while it is not. */
export function feedbackAge(measuredMs: number | null, now: number): string | null {
  const ageMs = measuredMs === null ? 0 : now - measuredMs;
  return ageMs < STALE_MS ? null : ageLabel(ageMs);
}

/** "3 s", "2 min" */
export function ageLabel(ageMs: number): string {
  const seconds = Math.floor(ageMs / 1000);
  return seconds < 100 ? `${seconds} s` : `${Math.floor(seconds / 60)} min`;
}
