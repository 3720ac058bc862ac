import { eventGap } from "../gate/serial";

/** A segment of sound that plays, or is too old to. */
export interface HeardSegment {
  readonly stamp: number;
  readonly atMs: number; // when it began
  readonly leftOut: number; // so many segments were left out until then: they came too late to begin
}

/** What is known of the sound of one microphone. Checked by tests/vectors/pacing.json. */
export interface AwaitedSound extends HeardSegment {
  readonly tolerance: number; // events
  readonly event: number; // newest feedback then
  readonly farMs: number; // for how long sound came that was too far behind, since the last that was not
  readonly pausesUntilMs: number; // silence that begins before is taken for a pause
}

/** No segment lasts longer, and sound that pauses is waited for no longer. */
const HOLE_MS = 200;
const PAUSES_FOR_MS = 10_000;
const FAR_FOR_MS = 3000;

/**
 * A segment began. `before`: what was known of its microphone; `event`: newest feedback; `mostGap`: sound farther behind
 * is too far.
 */
export function hear(
  before: AwaitedSound | undefined,
  segment: HeardSegment,
  event: number,
  tolerance: number,
  mostGap: number,
): AwaitedSound {
  const { atMs, stamp } = segment;
  const holeMs = before === undefined ? 0 : atMs - before.atMs;
  const paused = before !== undefined && holeMs > HOLE_MS && wasPause(before, segment, event);
  const isFar = eventGap(event, stamp) > mostGap;
  return {
    ...segment,
    tolerance,
    event,
    farMs: isFar ? (before?.farMs ?? 0) + Math.min(holeMs, HOLE_MS) : 0,
    pausesUntilMs: paused ? atMs + PAUSES_FOR_MS : (before?.pausesUntilMs ?? -Infinity),
  };
}

/** So far behind the feedback may sound be that the next event does not take it out of its tolerance. */
export function mostBehind(tolerance: number): number {
  return Math.max(tolerance - 1, 0);
}

/**
 * Late sound goes on where it stopped, or is left out. After a pause nothing is, and it is no farther behind than
 * before, whatever has passed.
 */
function wasPause(before: AwaitedSound, { stamp, leftOut }: HeardSegment, event: number): boolean {
  if (leftOut !== before.leftOut) return false;
  return eventGap(event, before.event) > 2 && eventGap(event, stamp) <= eventGap(before.event, before.stamp);
}

/**
 * Whether events wait for this microphone: for `awaitedMs` after its last segment. None waits for sound that was too far
 * behind for 3 s, with or without pauses: its path is too slow.
 */
export function isAwaited(sound: AwaitedSound, awaitedMs: number, now: number): boolean {
  if (sound.farMs > FAR_FOR_MS) return false;
  return now - sound.atMs < (sound.atMs < sound.pausesUntilMs ? Math.min(HOLE_MS, awaitedMs) : awaitedMs);
}
