import { judge } from "./media_gate";
import { createCounts, noteRendered, type GateContext, type MediumCounts } from "./medium_counts";

/** When no new segment came for this long, what plays is the decoder's concealment: its own invention. */
const CONCEALED_MS = 200;

/** The gate of one audio stream. A segment counts by the verdict at its start. */
export interface SoundGate {
  readonly counts: MediumCounts;
  playing: number | null; // RTP timestamp of the segment being played
  playingSinceMs: number;
  judged: boolean; // whether that segment is counted
}

export function createSoundGate(): SoundGate {
  return { counts: createCounts(), playing: null, playingSinceMs: 0, judged: false };
}

/**
 * Takes the segment being played; says whether it may be heard now.
 * `stamp` is undefined while nothing is known of it. `audible`: whether sound is on; silence renders nothing.
 */
export function observeSound(
  gate: SoundGate,
  rtpTimestamp: number,
  stamp: number | null | undefined,
  context: GateContext,
  audible: boolean,
  now: number,
): boolean {
  const { counts } = gate;
  if (gate.playing !== rtpTimestamp) {
    gate.playing = rtpTimestamp;
    gate.playingSinceMs = now;
    gate.judged = false;
  }
  if (stamp === undefined && context.enabled) return false;
  const { verdict, gap } = judge(context.feedback, stamp ?? null, context.tolerance, context.enabled);
  if (stamp !== null && stamp !== undefined) counts.stamp = stamp;
  counts.gap = gap;
  if (!gate.judged && audible) {
    gate.judged = true;
    if (verdict === "render") noteRendered(counts, gap, context);
    else if (verdict === "hold") counts.held += 1;
    else counts.discarded += 1;
  }
  return verdict === "render" && now - gate.playingSinceMs < CONCEALED_MS;
}
