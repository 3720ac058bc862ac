/** Waits between attempts to connect: doubling, capped, with jitter; from the start again after a healthy spell. */
export interface Backoff {
  readonly firstMs: number; // 300
  readonly capMs: number; // 5000
  readonly healthyMs: number; // a connection that lived this long was healthy; 5000
  attempts: number; // failed in a row
}

export function createBackoff(firstMs = 300, capMs = 5000, healthyMs = 5000): Backoff {
  return { firstMs, capMs, healthyMs, attempts: 0 };
}

/** The wait before the next attempt. `random`: 0 to 1; the wait varies by a quarter either way. */
export function nextWait(backoff: Backoff, random: number): number {
  const base = Math.min(backoff.capMs, backoff.firstMs * 2 ** Math.min(backoff.attempts, 16));
  backoff.attempts += 1;
  return Math.min(backoff.capMs, base * (0.75 + random / 2));
}

/** A connection ended after it had lived this long. */
export function noteLifetime(backoff: Backoff, livedMs: number): void {
  if (livedMs >= backoff.healthyMs) backoff.attempts = 0;
}
