import type { SoundContext } from "../../gate/gate_counters";
import { judge, type Verdict } from "../../gate/media_gate";
import { eventGap } from "../../gate/serial";
import { createSoundJitter, noteLateness, targetS, type SoundJitter } from "./sound_jitter";
import {
  advance,
  createSoundQueue,
  current,
  enqueue,
  hole,
  peek,
  samplesBetween,
  unbroken,
  type SoundPacket,
  type SoundQueue,
} from "./sound_queue";
import { crossFade, findPeriod } from "./sound_splice";

/**
 * Plays one microphone's packets, frame by frame of 5 ms, at their own sample rate; `sound_resampler.ts` makes the sound
 * device's rate of it. Sound waits as long as packets are late (`sound_jitter.ts`). While more waits than that, periods
 * of it are left out; a missing packet's place is taken by the last period, which fades. All joins are cross-faded.
 */
export interface SoundPlayer {
  readonly queue: SoundQueue;
  jitter: SoundJitter;
  readonly blockS: number; // that the sound device takes at once
  context: SoundContext; // set by `judgeAgainst`
  eventS: number; // between two events, on average; Infinity before two came
  eventAt: number; // s on the sound device's clock: when the last came
  plays: boolean; // false: waits for enough sound to begin with
  lead: number; // s that sound waits that came as early as any, on average
  arrived: { readonly late: number; readonly now: number } | null; // the last packet: s after the earliest, and when
  history: Float32Array; // the last samples played
  filler: Filler | null; // plays now
  joins: Float32Array | null; // what would have come next: the next frame begins with it, and fades from it
  sinceSplice: number; // samples
  hurriesUntil: number; // s on the sound device's clock
  playing: number | null; // RTP timestamp of the packet that plays; null in a silence
  begun: number[]; // RTP timestamps of packets that began to play, until somebody takes them
  leftOut: number; // packets that came and did not play
  loudness: number; // of the last sample: 0 while what plays is too old, else 1
}

/** Invented sound in the place of missing sound. */
interface Filler {
  readonly period: Float32Array;
  at: number; // samples so far
}

const FRAME_S = 0.005;
/** Periods of sound, from a high voice's to a low motor's. */
const SHORTEST_S = 0.0025;
const LONGEST_S = 0.0125;
const HISTORY_S = 0.03;
/** How long missing sound is invented: with it, the longest packet's place fades away. */
const FILLER_S = 0.06;
/** So much more than must wait is left to the clocks, ... */
const SPARE_S = 0.012;
/** ... and more than this, or a hurry, makes sound play faster by a half instead of an eighth. */
const MUCH_S = 0.1;
const SPLICE_EACH_S = 0.06;
const SPLICE_EACH_HURRIED_S = 0.015;
/** Sound that repeats itself less than that is cut only when much waits. */
const LIKE = 0.5;
/** What plays is soon as old as it may be, ... */
const SOON_S = 0.1;
/** ... and for so long nothing waits for what may come late. */
const HURRY_S = 1;
const HURRIED_TARGET_S = 0.02;
/** Weight of one packet in `lead`. */
const WEIGHT = 1 / 16;
/** Weight of one event in `eventS`. */
const EVENT_WEIGHT = 1 / 8;
/** RTP timestamps that jump by more begin anew. */
const JUMP_S = 3;
/** Packets that wait; of more the oldest give way. */
const MOST_PACKETS = 50;
/** The clock of a sound device that a browser opens runs for a buffer, and then stands still for a second or two. */
const OPENED_S = 0.1;
/** How much faster or slower sound plays where the clocks of the robot and of the sound device differ. */
const MOST_DRIFT = 0.005;
const DRIFT_PER_S = 0.2;

export function createSoundPlayer(rate: number, blockS: number): SoundPlayer {
  return {
    queue: createSoundQueue(),
    jitter: createSoundJitter(rate),
    blockS,
    context: { feedback: null, tolerance: 0, gate: "event" },
    eventS: Infinity,
    eventAt: -Infinity,
    plays: false,
    lead: 0,
    arrived: null,
    history: new Float32Array(Math.round(rate * HISTORY_S)),
    filler: null,
    joins: null,
    sinceSplice: 0,
    hurriesUntil: -Infinity,
    playing: null,
    begun: [],
    leftOut: 0,
    loudness: 1,
  };
}

/** The feedback or a setting changed. */
export function judgeAgainst(player: SoundPlayer, context: SoundContext, now: number): void {
  const before = player.context.feedback;
  player.context = context;
  const events = before === null || context.feedback === null ? 0 : eventGap(context.feedback, before);
  if (events === 0) return;
  const each = (now - player.eventAt) / Math.max(1, events);
  player.eventS = player.eventS === Infinity ? each : player.eventS + (each - player.eventS) * EVENT_WEIGHT;
  player.eventAt = now;
}

/** A packet came. `now`: s on the sound device's clock. */
export function takePacket(player: SoundPlayer, packet: SoundPacket, now: number): void {
  if (now < OPENED_S) return;
  const { queue } = player;
  const { rate, latest } = player.jitter;
  if (queue.next !== null) player.leftOut += packet.gaveWay; // before that nothing was to play
  const expected = latest?.time ?? packet.time;
  if (Math.abs(samplesBetween(expected, packet.time)) > JUMP_S * rate) beginAnew(player);
  const late = noteLateness(player.jitter, packet.time, packet.arrivedS);
  const refused = enqueue(queue, packet);
  if (refused === "late") player.leftOut += 1;
  if (refused !== null) return;
  while (queue.packets.length > MOST_PACKETS) leaveOut(player, 1);
  player.arrived = { late, now };
  if (!player.plays || queue.next === null) return;
  const wait = late + samplesBetween(queue.next, packet.time) / rate;
  player.lead += (wait - player.lead) * WEIGHT;
}

/** The next 5 ms, at the rate of the packets. */
export function nextFrame(player: SoundPlayer, now: number): Float32Array {
  const length = samples(player, FRAME_S);
  const frame = new Float32Array(length);
  skipTooOld(player);
  const loudness = allowedLoudness(player);
  for (let at = 0; at < length;) {
    if (!player.plays) begin(player, now);
    if (!player.plays) break;
    const piece = nextPiece(player, length - at, now);
    frame.set(piece, at);
    at += piece.length;
    player.history.copyWithin(0, piece.length);
    player.history.set(piece, player.history.length - piece.length);
  }
  return fadeTo(player, loudness, frame);
}

/**
 * Sound that is too old goes on in silence while there is no other: the page's own gate shuts later, because it hears of
 * the feedback at the same time but of what plays afterwards.
 */
function allowedLoudness(player: SoundPlayer): number {
  const next = player.queue.packets[0];
  if (next === undefined) return player.loudness;
  return verdictOf(player, next) === "discard" ? 0 : 1;
}

function verdictOf({ context }: SoundPlayer, { stamp }: SoundPacket): Verdict {
  return judge(context.feedback, stamp, context.tolerance, context.gate).verdict;
}

/** A step would click. Sound that was never heard does not fade out: it is silent from its first sample on. */
function fadeTo(player: SoundPlayer, loudness: number, frame: Float32Array): Float32Array {
  const from = player.playing === null && loudness === 0 ? 0 : player.loudness;
  player.loudness = loudness;
  if (from === 1 && loudness === 1) return frame;
  return frame.map((sample, at) => sample * (from + ((loudness - from) * (at + 1)) / frame.length));
}

/** How fast frames are to be played: 1, or a few per mille from it, so that what waits comes to what must. */
export function playingRate(player: SoundPlayer, now: number): number {
  if (!player.plays) return 1;
  const drift = spare(player, now) * DRIFT_PER_S;
  return 1 + Math.min(MOST_DRIFT, Math.max(-MOST_DRIFT, drift));
}

/** Ms of sound that waits behind what plays. */
export function waitingMs(player: SoundPlayer): number {
  const { next, packets } = player.queue;
  const last = packets.at(-1);
  if (last === undefined || next === null) return 0;
  return ((samplesBetween(next, last.time) + last.samples.length) / player.jitter.rate) * 1000;
}

/** Begins once what waits would have waited for long enough if it had come as early as any. */
function begin(player: SoundPlayer, now: number): void {
  const { queue, arrived, jitter } = player;
  if (arrived === null) return;
  const first = queue.packets[0];
  if (first !== undefined && verdictOf(player, first) === "render") hurryIfOld(player, first, now);
  const target = targetNow(player, now);
  const leadFrom = (first: number): number => {
    const [from, last] = [queue.packets[first], queue.packets.at(-1)];
    if (from === undefined || last === undefined) return -1;
    return arrived.late + samplesBetween(from.time, last.time) / jitter.rate + now - arrived.now;
  };
  if (leadFrom(0) < target) return;
  // At the very beginning the newest is enough; later nothing that came is left out.
  while (queue.next === null && leadFrom(1) >= target) queue.packets.shift();
  player.lead = leadFrom(0);
  queue.next = queue.packets[0]?.time ?? null;
  player.plays = true;
  player.sinceSplice = 0;
  player.joins = new Float32Array(samples(player, FRAME_S));
}

/** Up to `most` samples. */
function nextPiece(player: SoundPlayer, most: number, now: number): Float32Array {
  const { queue, filler, joins } = player;
  const ready = unbroken(queue);
  player.sinceSplice += most;
  if (ready === 0 || (ready < most && (filler !== null || joins !== null))) return fill(player, most, now);
  noteBegun(player, now);
  if (filler !== null || joins !== null) {
    const from = comingNext(player, most);
    player.filler = null;
    player.joins = null;
    return crossFade(from, take(player, most));
  }
  return shortened(player, most, ready, now) ?? take(player, Math.min(most, ready));
}

function take(player: SoundPlayer, length: number): Float32Array {
  const found = peek(player.queue, 0, length);
  advance(player.queue, length);
  return found;
}

function noteBegun(player: SoundPlayer, now: number): void {
  const packet = current(player.queue);
  if (packet === null || packet.time === player.playing) return;
  player.playing = packet.time;
  player.begun.push(packet.time);
  hurryIfOld(player, packet, now);
}

/** What is, or soon will be, as old as it may be waits for nothing that may come late. */
function hurryIfOld(player: SoundPlayer, packet: SoundPacket, now: number): void {
  const { feedback, tolerance, gate } = player.context;
  const { gap } = judge(feedback, packet.stamp, tolerance, gate);
  const soon = Math.floor(SOON_S / player.eventS); // events
  if (gate === "event" && gap !== null && gap >= tolerance - soon) player.hurriesUntil = now + HURRY_S;
}

/** What would be heard next if nothing were joined there. */
function comingNext(player: SoundPlayer, length: number): Float32Array {
  if (player.joins !== null) return player.joins;
  if (player.filler === null && unbroken(player.queue) >= length) return peek(player.queue, 0, length);
  return invent(player, length);
}

/** Fills a hole of up to `length` samples, and the time until anything comes; falls silent after a while. */
function fill(player: SoundPlayer, length: number, now: number): Float32Array {
  const { queue, jitter } = player;
  const found = player.joins ?? invent(player, length);
  player.joins = null;
  const missing = hole(queue);
  // What is missing may still come, where less waits than must: the rest waits that much longer then.
  if (missing === null || spare(player, now) < 0) player.lead += length / jitter.rate;
  else advance(queue, Math.min(missing > 0 ? missing : unbroken(queue), length));
  if (player.filler !== null && player.filler.at >= samples(player, FILLER_S)) fallSilent(player);
  return found.subarray(0, length);
}

/** Goes on with the last period of what was heard, more softly with every sample. */
function invent(player: SoundPlayer, length: number): Float32Array {
  player.filler ??= { period: lastPeriod(player), at: 0 };
  const { filler } = player;
  const until = samples(player, FILLER_S);
  return Float32Array.from({ length }, () => {
    const sample = filler.period[filler.at % filler.period.length] ?? 0;
    const share = Math.max(0, 1 - filler.at / until);
    filler.at += 1;
    return sample * share;
  });
}

function lastPeriod(player: SoundPlayer): Float32Array {
  const { history } = player;
  const [width, least, most] = [FRAME_S, SHORTEST_S, LONGEST_S].map((seconds) => samples(player, seconds));
  // Backwards, a period later is a period earlier.
  const backwards = history.slice().reverse();
  const { length } = findPeriod(backwards, width ?? 0, least ?? 0, most ?? 0);
  return history.slice(history.length - length);
}

function fallSilent(player: SoundPlayer): void {
  player.plays = false;
  player.playing = null;
  player.filler = null;
}

/** A frame that leaves out a period behind it, where more waits than must; else null. */
function shortened(player: SoundPlayer, length: number, ready: number, now: number): Float32Array | null {
  const [width, least, most] = [FRAME_S, SHORTEST_S, LONGEST_S].map((seconds) => samples(player, seconds));
  if (width !== length || least === undefined || most === undefined) return null;
  const tooMuch = spare(player, now);
  const hurries = tooMuch > MUCH_S || now < player.hurriesUntil;
  const each = samples(player, hurries ? SPLICE_EACH_HURRIED_S : SPLICE_EACH_S);
  if (tooMuch < SPARE_S || player.sinceSplice < each || ready < width + 2 * most) return null;
  const sound = peek(player.queue, 0, width + most);
  const period = findPeriod(sound, width, least, most);
  if (period.likeness < LIKE && !hurries) return null;
  advance(player.queue, period.length + width);
  player.lead -= period.length / player.jitter.rate;
  player.sinceSplice = 0;
  return crossFade(sound.subarray(0, width), sound.subarray(period.length, period.length + width));
}

/** Where the next sound is too old, goes on at once with the first that is not. */
function skipTooOld(player: SoundPlayer): void {
  const verdicts = player.queue.packets.map((packet) => verdictOf(player, packet));
  if (verdicts[0] !== "discard") return;
  const first = verdicts.indexOf("render");
  if (first > 0) leaveOut(player, first);
}

function leaveOut(player: SoundPlayer, count: number): void {
  const { queue, jitter } = player;
  if (player.plays) player.joins = comingNext(player, samples(player, FRAME_S)).slice();
  player.filler = null;
  const out = queue.packets.splice(0, count);
  player.leftOut += out.filter(({ time }) => time !== player.playing).length;
  const first = queue.packets[0];
  if (queue.next === null || first === undefined) return;
  player.lead -= Math.max(0, samplesBetween(queue.next, first.time)) / jitter.rate;
  queue.next = first.time;
}

/** The RTP timestamps belong to another run of the stream. */
function beginAnew(player: SoundPlayer): void {
  player.leftOut += player.queue.packets.filter(({ time }) => time !== player.playing).length;
  if (player.plays && player.joins === null) player.filler ??= { period: lastPeriod(player), at: 0 }; // and then silence
  player.queue.packets = [];
  player.queue.next = null;
  player.jitter = createSoundJitter(player.jitter.rate);
}

/** S that waits longer than it must. */
function spare(player: SoundPlayer, now: number): number {
  return player.lead - targetNow(player, now);
}

function targetNow(player: SoundPlayer, now: number): number {
  return now < player.hurriesUntil ? HURRIED_TARGET_S : targetS(player.jitter, player.blockS);
}

function samples(player: SoundPlayer, seconds: number): number {
  return Math.round(player.jitter.rate * seconds);
}
