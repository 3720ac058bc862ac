import { eventGap } from "../gate/serial";

export type Pacing = "feedback" | "media";

/** What is known of the sound of one microphone. Checked by tests/vectors/pacing.json. */
export interface AwaitedSound {
  readonly stamp: number; // of what played last
  readonly tolerance: number; // events
  readonly atMs: number; // when it played last
  readonly event: number; // newest feedback then
  readonly tooOldSinceMs: number | null; // null: it is not
  readonly pausesUntilMs: number; // silence that begins before is taken for a pause
}

/**
 * Sound that fell silent is waited for so long: what is late may still come. With feedback pacing each wait is short;
 * with media pacing the next command waits until then, and the robot must not come to rest.
 */
const AWAITED_MS: Readonly<Record<Pacing, number>> = { feedback: 600, media: 200 };
/** No segment lasts longer. Sound that pauses is waited for no longer either. */
const HOLE_MS = 200;
const PAUSES_FOR_MS = 10_000;
const TOO_OLD_FOR_MS = 3000;

/** The sound of this stamp plays now, or is too old to. `before`: what was known of its microphone. */
export function hear(
  before: AwaitedSound | undefined,
  stamp: number,
  event: number,
  tolerance: number,
  now: number,
): AwaitedSound {
  const holeMs = before === undefined ? Infinity : now - before.atMs;
  const isTooOld = eventGap(event, stamp) > tolerance;
  const since = holeMs > AWAITED_MS.feedback ? null : (before?.tooOldSinceMs ?? null);
  const paused = before !== undefined && holeMs > HOLE_MS && wasPause(before, stamp, event);
  return {
    stamp,
    tolerance,
    atMs: now,
    event,
    tooOldSinceMs: isTooOld ? (since ?? now) : null,
    pausesUntilMs: paused ? now + PAUSES_FOR_MS : (before?.pausesUntilMs ?? -Infinity),
  };
}

/** Late sound goes on where it stopped. After a pause it is no farther behind than before, whatever has passed. */
function wasPause(before: AwaitedSound, stamp: number, event: number): boolean {
  return (
    eventGap(event, before.event) > 2 && eventGap(event, stamp) <= eventGap(before.event, before.stamp) + 1
  );
}

/** Whether events wait for this microphone. None waits for sound that has been too old for 3 s: its path is too slow. */
export function isAwaited(sound: AwaitedSound, pacing: Pacing, now: number): boolean {
  if (sound.tooOldSinceMs !== null && now - sound.tooOldSinceMs > TOO_OLD_FOR_MS) return false;
  return now - sound.atMs < (sound.atMs < sound.pausesUntilMs ? HOLE_MS : AWAITED_MS[pacing]);
}
