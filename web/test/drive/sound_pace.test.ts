import { describe, expect, it } from "vitest";
import {
  CALM_INTERVAL_MS,
  createCommandGate,
  gateState,
  noteHeard,
  noteSent,
  takeFeedback,
  type Pacing,
} from "../../src/drive/command_gate";
import { judge } from "../../src/gate/media_gate";
import { eventAfter } from "../../src/gate/serial";
import { createSoundPlayer, judgeAgainst, nextFrame, takePacket } from "../../src/media/sound/sound_player";

/**
 * The command gate and the player of sound together, as the page has them, over the thesis' network of section 4.1
 * (`bench/lockstep/emulator/profiles/macro-lan.toml`): commands and sound have delays of their own that wander.
 */
const TOLERANCE = 4; // events
const EVENT_RATE = 60; // Hz
const RATE = 8000; // Hz
const PACKET_MS = 20;
const FRAME_MS = 5;
const VARY_MS = 500;
const LOSS = 0.005; // one way
/** What a loss costs: a repeat of ours, TCP's shortest timer, and its timer where the round trip has varied. */
const REPEAT_MS = { control: 60, link: 200, variedLink: 350 };
const HOLD_MS = 300;
const TALKS_MS = 500;
const SECONDS = 30;

/** One way, in ms: lognormal above `min`, none above `max`. */
interface Delay {
  readonly min: number;
  readonly mu: number;
  readonly max: number;
}

const SIGMA = 1.36;
const CONTROL: Delay = { min: 0, mu: 2.36, max: 336 };
const LINK: Delay = { min: 5, mu: 2.5, max: 386 };
/** What a page on a busy machine adds to it. */
const BUSY_MS = 50;

interface Run {
  readonly share: number; // of segments that were left out
  readonly segments: number;
  readonly eventRate: number; // Hz
}

/** Marsaglia's xorshift of 32 bits: the same numbers in each run, 0 to 1. */
function seeded(seed: number): () => number {
  let state = seed * 2_654_435_761 || 1;
  return () => {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    return (state >>> 0) / 2 ** 32;
  };
}

function drawn(random: () => number, { min, mu, max }: Delay): number {
  const normal = Math.sqrt(-2 * Math.log(1 - random())) * Math.cos(2 * Math.PI * random());
  return Math.min(max, min + Math.exp(mu + SIGMA * normal));
}

/** When what is sent at a time arrives: the delay moves evenly between values that are drawn, and none overtakes. */
function path(seed: number, delay: Delay, repeatMs: number): (ms: number) => number {
  const random = seeded(seed);
  const knots = [drawn(random, delay)];
  let last = 0;
  return (ms) => {
    const knot = Math.floor(ms / VARY_MS);
    while (knots.length < knot + 2) knots.push(drawn(random, delay));
    const [from = 0, to = 0] = knots.slice(knot);
    const wandering = from + (to - from) * (ms / VARY_MS - knot);
    last = Math.max(last, ms + wandering + (random() < LOSS ? repeatMs : 0));
    return last;
  };
}

/** `pauseMs`: the microphone sends nothing for so long after each half second. */
function drive(
  pacing: Pacing,
  seed: number,
  blockMs: number,
  busyMs: number,
  linkMs = REPEAT_MS.link,
  pauseMs = 0,
): Run {
  const up = path(seed, CONTROL, REPEAT_MS.control);
  const down = path(seed + 100, CONTROL, REPEAT_MS.control);
  const link = path(seed + 200, LINK, linkMs);
  const gate = createCommandGate(pacing, TOLERANCE, 1000 / EVENT_RATE, CALM_INTERVAL_MS, HOLD_MS);
  const player = createSoundPlayer(RATE, blockMs / 1000);
  const stamps: number[] = []; // by packet
  const coming: { readonly index: number; readonly at: number }[] = [];
  let [robot, captured, events] = [1, 1, 0];
  let [executesAt, answersAt] = [Infinity, Infinity];
  let [heard, heardMs] = [1, -Infinity];
  let [begun, leftOut, unplayed] = [0, 0, 0];
  takeFeedback(gate, robot, 1);

  const runRobot = (ms: number): void => {
    if (ms >= executesAt) {
      robot = eventAfter(robot);
      executesAt = Infinity;
      answersAt = down(ms);
    }
    if (ms % PACKET_MS !== 0) return;
    stamps.push(captured);
    const isPause = ms % (TALKS_MS + pauseMs) >= TALKS_MS;
    if (!isPause) coming.push({ index: stamps.length - 1, at: link(ms) + busyMs });
    captured = robot;
  };
  const receive = (ms: number): void => {
    if (ms >= answersAt) {
      takeFeedback(gate, robot, 1);
      answersAt = Infinity;
      events += 1;
      judgeAgainst(player, { feedback: robot, tolerance: TOLERANCE, gate: "event" }, ms / 1000);
    }
    for (let next = coming[0]; next !== undefined && next.at <= ms; next = coming[0]) {
      coming.shift();
      const samples = new Float32Array((RATE * PACKET_MS) / 1000).fill(0.1);
      const time = next.index * samples.length;
      takePacket(
        player,
        { time, stamp: stamps[next.index] ?? null, arrivedS: ms / 1000, gaveWay: 0, samples },
        ms / 1000,
      );
    }
  };
  const play = (ms: number): void => {
    for (let frame = 0; frame < blockMs / FRAME_MS; frame++) nextFrame(player, ms / 1000);
    leftOut += player.leftOut;
    unplayed += player.leftOut;
    player.leftOut = 0;
    for (const time of player.begun.splice(0)) {
      heard = stamps[(time / RATE) * (1000 / PACKET_MS)] ?? heard;
      heardMs = ms;
      begun += 1;
      leftOut += judge(gate.event, heard, TOLERANCE, "event").verdict === "discard" ? 1 : 0;
    }
  };
  for (let ms = 0; ms < SECONDS * 1000; ms++) {
    runRobot(ms);
    receive(ms);
    if (ms % blockMs === 0) play(ms);
    const segment = heardMs < 0 ? null : { stamp: heard, atMs: heardMs, leftOut: unplayed };
    noteHeard(gate, [{ microphone: "front", segment, tolerance: TOLERANCE }], ms);
    gate.shown = gate.event; // no picture holds anything up
    if (gateState(gate, ms) !== "open") continue;
    noteSent(gate, ms);
    executesAt = up(ms);
  }
  return { share: leftOut / stamps.length, segments: begun, eventRate: events / SECONDS };
}

describe("sound and the pace of events, over a network whose delays wander", () => {
  const cases = [1, 2, 3].flatMap((seed) => [10, 25].map((blockMs) => ({ seed, blockMs })));

  it.each(cases)("leaves out at most 2 % of the sound: $seed, blocks of $blockMs ms", ({ seed, blockMs }) => {
    const quiet = drive("feedback", seed, blockMs, 0);
    const busy = drive("feedback", seed, blockMs, BUSY_MS);
    const varied = drive("feedback", seed, blockMs, 0, REPEAT_MS.variedLink);
    expect(quiet.segments).toBeGreaterThan(SECONDS * 45);
    expect(quiet.share).toBeLessThan(0.02);
    expect(busy.share).toBeLessThan(0.02);
    expect(varied.share).toBeLessThan(0.02);
    expect(busy.eventRate).toBeGreaterThan(12);
  });

  it.each([1, 2, 3])("does not let a microphone that pauses slow the operator: %i", (seed) => {
    const without = drive("feedback", seed, 10, 0).eventRate;
    for (const pauseMs of [250, 400, 700]) {
      const { eventRate } = drive("feedback", seed, 10, 0, REPEAT_MS.link, pauseMs);
      expect(eventRate).toBeGreaterThan(0.8 * without);
    }
  });
});
