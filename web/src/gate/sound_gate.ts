import { judge } from "./media_gate";
import { MOST_MS } from "./sound_backlog";
import {
  UNMARKED,
  createGateCounters,
  noteRendered,
  noteSeen,
  type FrameMark,
  type GateContext,
  type GateCounters,
} from "./gate_counters";

/** When no new segment came for this long, what plays is the decoder's concealment: its own invention. */
const CONCEALED_MS = 200;
/** A browser that has not worked off the sound of its start by then is not about to. */
export const START_MS = 5000;

/** The gate of one audio stream. A segment counts by the verdict at its start. */
export interface SoundGate {
  readonly counts: GateCounters;
  playing: number | null; // RTP timestamp of the segment being played
  playingSinceMs: number;
  judged: boolean; // whether that segment is counted
  isTooOld: boolean; // what plays now
  isAhead: boolean; // its event has not come
  starting: boolean; // nothing was heard yet, and the browser plays what waited while it opened its sound device
  playsSinceMs: number | null; // anything at all
}

const NOT_STARTED = { starting: true, playsSinceMs: null };

export function createSoundGate(): SoundGate {
  return {
    counts: createGateCounters(),
    playing: null,
    playingSinceMs: 0,
    judged: false,
    isTooOld: false,
    isAhead: false,
    ...NOT_STARTED,
  };
}

/**
 * Takes the segment being played; says whether it may be heard now.
 * `found` is undefined while nothing is known of it. `audible`: whether sound is on; silence renders nothing.
 * `waiting`: ms of sound that arrived and waits behind it. What is too old because the browser began late is its start,
 * and no lag of the path: it is not heard, and not counted.
 */
export function observeSound(
  gate: SoundGate,
  rtpTimestamp: number,
  found: FrameMark | undefined,
  context: GateContext,
  audible: boolean,
  now: number,
  waiting: number,
): boolean {
  const { counts } = gate;
  gate.playsSinceMs ??= now;
  if (gate.playing !== rtpTimestamp) {
    gate.playing = rtpTimestamp;
    gate.playingSinceMs = now;
    gate.judged = false;
  }
  if (found === undefined && context.gate !== "off") return false;
  const mark = found ?? UNMARKED;
  const { stamp } = mark;
  const { verdict, gap } = judge(context.feedback, stamp, context.tolerance, context.gate);
  if (stamp !== null) counts.stamp = stamp;
  gate.isTooOld = verdict === "discard";
  gate.isAhead = verdict === "hold";
  gate.starting &&= verdict === "discard" && waiting > MOST_MS && now - gate.playsSinceMs < START_MS;
  if (gate.starting) return false;
  noteSeen(counts, gap);
  counts.gap = gap;
  if (!gate.judged && audible) {
    gate.judged = true;
    counts.received += 1;
    if (verdict === "render") noteRendered(counts, gap, context);
    else if (verdict === "hold") counts.held += 1;
    else counts.discarded += 1;
  }
  return verdict === "render" && !isConcealed(gate, now);
}

/** Whether the segment last observed has played for longer than any lasts. */
function isConcealed(gate: SoundGate, now: number): boolean {
  return now - gate.playingSinceMs >= CONCEALED_MS;
}
