/**
 * Sound that arrived and waits to be played. A browser that opens its sound device late finds seconds of it waiting,
 * plays from the oldest, and catches up only by playing a little faster: for long nothing would pass the gate.
 * Leaving out as much of what comes next lets it catch up at once.
 */
export interface SoundBacklog {
  overSinceMs: number | null; // when the backlog became too long; null while it is not
  skipTo: number | null; // RTP timestamp before which sound is left out; null: nothing is
}

export const MOST_MS = 250;
/** So much is never of use, whether it is heard or not. */
const TOO_MUCH_MS = 1000;
/** After an outage the newest sound is far ahead for a moment, until the jitter buffer goes on with it. */
const PATIENCE_MS = 300;
const KEEP_MS = 40;

/** Frames of one stream, as they came to the decoder. */
export interface Arrivals {
  newest: number | null; // RTP timestamp of the frame that arrived last
  queued: number | null; // of the last that went on to the decoder
  dropped: number; // thrown away before decoding
}

export function createArrivals(): Arrivals {
  return { newest: null, queued: null, dropped: 0 };
}

export function noteArrival(arrivals: Arrivals, rtpTimestamp: number, dropped: boolean): void {
  arrivals.newest = rtpTimestamp;
  if (dropped) arrivals.dropped += 1;
  else arrivals.queued = rtpTimestamp;
}

export function createSoundBacklog(): SoundBacklog {
  return { overSinceMs: null, skipTo: null };
}

/** `newer - older` of RTP timestamps (RFC 3550 5.1: 32 bits, they wrap). */
export function rtpGap(newer: number, older: number): number {
  return (newer - older) | 0;
}

/** How much sound waits behind what plays. `queued`: the last that went on to the decoder. */
export function waitingMs(queued: number, playing: number, clockRate: number): number {
  return (rtpGap(queued, playing) / clockRate) * 1000;
}

/**
 * Takes the last sound that went on to the decoder and the one being played; says from where to go on, or null: leave
 * nothing out. What was dropped before the decoder does not wait, else what comes next would be left out for it as well.
 * `isTooOld`: what plays does not pass the gate. While it does, what waits is the browser's buffer against jitter, which
 * fills again after each time that something is left out: sound would be lost for nothing.
 */
export function skipTarget(
  backlog: SoundBacklog,
  queued: number,
  playing: number,
  clockRate: number,
  now: number,
  isTooOld: boolean,
): number | null {
  if (backlog.skipTo !== null && rtpGap(backlog.skipTo, playing) > 0) return null;
  backlog.skipTo = null;
  const waiting = rtpGap(queued, playing);
  if (waitingMs(queued, playing, clockRate) <= (isTooOld ? MOST_MS : TOO_MUCH_MS)) {
    backlog.overSinceMs = null;
    return null;
  }
  backlog.overSinceMs ??= now;
  if (now - backlog.overSinceMs < PATIENCE_MS) return null;
  backlog.overSinceMs = null;
  backlog.skipTo = (queued + waiting - (KEEP_MS * clockRate) / 1000) >>> 0;
  return backlog.skipTo;
}
