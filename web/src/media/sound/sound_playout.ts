import { rtpGap } from "../../gate/sound_backlog";

/** One packet's sound. Times in s on the sound device's clock. */
export interface Segment {
  readonly time: number; // RTP timestamp
  start: number;
  end: number;
}

/**
 * When packets of sound play: in the rhythm of their RTP timestamps, each about as long after it was sent as the latest
 * of the last seconds came. One that comes too late to keep the rhythm plays at once, and what follows waits that much
 * longer; while more waits than that, sound plays a little faster. More waits when the path has become quiet, and when
 * the sound device lost time: that of a busy machine may lose a tenth.
 *
 * Where that much is more than the tolerance allows, `hurry`: for a while nothing waits for what may come late, and
 * sound plays faster by a half. It is better heard so, and with holes, than not at all.
 */
export interface SoundPlayout {
  readonly clockRate: number; // Hz, of the RTP timestamps
  segments: Segment[]; // what plays and what waits, in order
  line: { readonly time: number; at: number } | null; // the rhythm: `time` plays at `at`
  latest: Latest | null; // null before the first packet
  hurriesUntilS: number; // on the clock of `arrivedS`
}

/** How late packets came at most, in s after `time` came, less what lies between the two by their timestamps. */
interface Latest {
  readonly time: number;
  readonly arrivedS: number;
  sinceS: number; // when the span began
  now: number; // in this span
  before: number; // in the one before
}

export interface Place {
  readonly segment: Segment;
  readonly rate: number; // 1, or the little more that shortens the wait
  readonly repeat: Segment | null; // where the sound before is played again: a lost packet's place
}

/** The clock of a sound device that a browser opens runs for a buffer, and then stands still for a second or two. */
const OPENED_S = 0.1;
/** A packet waits at least this long: those after it may come as much later. */
const LEAD_S = 0.02;
/** What waits this much longer than it must is worth catching up. */
const SPARE_S = 0.01;
const SPAN_S = 1; // of `Latest`
/** Of what waits too long, so much is caught up in a second, ... */
const CATCH_UP = 0.5;
const MOST_FASTER = 0.15; // ... but no more: it is heard
/** How much faster it plays in a hurry, ... */
const HURRY = 0.5;
/** ... and for how long, in s. */
const HURRY_S = 1;
/** More is never of use, whether it passes the gate or not. */
const MOST_LEAD_S = 1;
/** RTP timestamps that jump by more begin anew. */
const JUMP_S = 3;
/** Shorter holes are rounding. */
const SEAM_S = 0.003;
/** A hole as long as the longest packet, 60 ms, is filled with what came before it. */
const REPEAT_S = 0.065;

/** Whether the sound device plays: what waits before would be as late as the opening takes. `now`: s on its clock. */
export function isOpened(now: number): boolean {
  return now >= OPENED_S;
}

export function createSoundPlayout(clockRate: number): SoundPlayout {
  return { clockRate, segments: [], line: null, latest: null, hurriesUntilS: -Infinity };
}

/** What plays is as old as it may be, at `nowS` of a clock that loses no time. */
export function hurry(playout: SoundPlayout, nowS: number): void {
  playout.hurriesUntilS = nowS + HURRY_S;
}

/**
 * Where `duration` s of sound play; null: left out, for too much waits. `now` is the sound device's time, `arrivedS`
 * that of a clock that loses none.
 */
export function placeSegment(
  playout: SoundPlayout,
  time: number,
  duration: number,
  now: number,
  arrivedS: number,
): Place | null {
  playout.segments = playout.segments.filter((segment) => segment.end > now);
  const last = playout.segments.at(-1) ?? null;
  const line = lineFor(playout, time, Math.max(now + LEAD_S, last?.end ?? 0), now);
  const due = dueAt(playout, line, time);
  if (due > now + MOST_LEAD_S) {
    line.at -= duration;
    return null;
  }
  const early = earlyBy(playout, time, arrivedS);
  const waits = due - now - LEAD_S;
  const rate = arrivedS < playout.hurriesUntilS ? hurriedRate(waits) : rateFor(waits - early);
  line.at -= duration - duration / rate;
  const start = last !== null && due < last.end + SEAM_S ? last.end : due;
  const segment = { time, start, end: start + duration / rate };
  const repeat = last === null ? null : holeBetween(last, start);
  playout.segments.push(...(repeat === null ? [] : [repeat]), segment);
  return { segment, rate, repeat };
}

/**
 * Where what plays does not pass, goes on at once with the first that does. Returns what is left out, and moves what
 * waits; nothing where none passes.
 */
export function goOn(playout: SoundPlayout, passes: (time: number) => boolean, now: number): Segment[] {
  playout.segments = playout.segments.filter((segment) => segment.end > now);
  const next = playout.segments.findIndex(({ time }) => passes(time));
  const first = playout.segments[next];
  if (next <= 0 || first === undefined || playout.line === null) return [];
  const earlier = first.start - now;
  const leftOut = playout.segments.splice(0, next);
  for (const segment of playout.segments) {
    segment.start -= earlier;
    segment.end -= earlier;
  }
  playout.line.at -= earlier;
  return leftOut;
}

/** RTP timestamp of what plays; undefined in a silence. */
export function playingAt(playout: SoundPlayout, now: number): number | undefined {
  return playout.segments.find(({ start, end }) => start <= now && now < end)?.time;
}

function dueAt(playout: SoundPlayout, line: NonNullable<SoundPlayout["line"]>, time: number): number {
  return line.at + rtpGap(time, line.time) / playout.clockRate;
}

/** The rhythm that holds, or another from `start` on where there is none that this packet could keep. */
function lineFor(
  playout: SoundPlayout,
  time: number,
  start: number,
  now: number,
): NonNullable<SoundPlayout["line"]> {
  const { line } = playout;
  if (line !== null) {
    const lead = dueAt(playout, line, time) - now;
    if (lead >= 0 && lead < JUMP_S) return line;
  }
  if (line === null || Math.abs(dueAt(playout, line, time) - now) >= JUMP_S) playout.latest = null;
  playout.line = { time, at: start };
  return playout.line;
}

/** How much earlier this packet came than the latest of the last one or two spans, in s. */
function earlyBy(playout: SoundPlayout, time: number, arrivedS: number): number {
  playout.latest ??= { time, arrivedS, sinceS: arrivedS, now: -Infinity, before: -Infinity };
  const { latest } = playout;
  if (arrivedS - latest.sinceS >= SPAN_S) {
    latest.before = latest.now;
    latest.now = -Infinity;
    latest.sinceS = arrivedS;
  }
  const late = arrivedS - latest.arrivedS - rtpGap(time, latest.time) / playout.clockRate;
  latest.now = Math.max(latest.now, late);
  return Math.max(latest.now, latest.before) - late;
}

/** `spare`: s that sound waits longer than it must. */
function rateFor(spare: number): number {
  return spare > SPARE_S ? 1 + Math.min(MOST_FASTER, spare * CATCH_UP) : 1;
}

function hurriedRate(waits: number): number {
  return waits > SPARE_S ? 1 + HURRY : 1;
}

function holeBetween(last: Segment, start: number): Segment | null {
  const length = start - last.end;
  return length > SEAM_S && length < REPEAT_S ? { time: last.time, start: last.end, end: start } : null;
}
