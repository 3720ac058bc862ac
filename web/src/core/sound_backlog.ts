/**
 * Sound that arrived and waits to be played. A browser that opens its sound device late finds seconds of it waiting,
 * plays from the oldest, and catches up only by playing a little faster: for long nothing would pass the gate.
 * Leaving out as much of what comes next lets it catch up at once.
 */
export interface SoundBacklog {
  overSinceMs: number | null; // when the backlog became too long; null while it is not
  skipTo: number | null; // RTP timestamp before which sound is left out; null: nothing is
}

const MOST_MS = 250;
/** After an outage the newest sound is far ahead for a moment, until the jitter buffer goes on with it. */
const PATIENCE_MS = 300;
const KEEP_MS = 40;

export function createSoundBacklog(): SoundBacklog {
  return { overSinceMs: null, skipTo: null };
}

/** `newer - older` of RTP timestamps (RFC 3550 5.1: 32 bits, they wrap). */
export function rtpGap(newer: number, older: number): number {
  return (newer - older) | 0;
}

/** Takes the newest sound that arrived and the one being played; says from where to go on, or null: leave nothing out. */
export function skipTarget(
  backlog: SoundBacklog,
  newest: number,
  playing: number,
  clockRate: number,
  now: number,
): number | null {
  if (backlog.skipTo !== null && rtpGap(backlog.skipTo, playing) > 0) return null;
  backlog.skipTo = null;
  const waiting = rtpGap(newest, playing);
  if ((waiting / clockRate) * 1000 <= MOST_MS) {
    backlog.overSinceMs = null;
    return null;
  }
  backlog.overSinceMs ??= now;
  if (now - backlog.overSinceMs < PATIENCE_MS) return null;
  backlog.overSinceMs = null;
  backlog.skipTo = (newest + waiting - (KEEP_MS * clockRate) / 1000) >>> 0;
  return backlog.skipTo;
}
