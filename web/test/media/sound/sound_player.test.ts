import { beforeEach, describe, expect, it } from "vitest";
import {
  createSoundPlayer,
  judgeAgainst,
  nextFrame,
  playingRate,
  takePacket,
  waitingMs,
  type SoundPlayer,
} from "../../../src/media/sound/sound_player";
import { createSoundResampler, resample } from "../../../src/media/sound/sound_resampler";

const RATE = 48_000;
const LENGTH = 960; // samples of a packet, 20 ms
const FRAME_S = 0.005;
const BLOCK_S = 0.01;
const HZ = 440;
const LEVEL = 0.5;
/** The steepest step between two samples of the tone, and a little more for a fade. */
const STEEPEST = LEVEL * ((2 * Math.PI * HZ) / RATE) * 1.6;

/** Ms by which packets are late on a path whose delay wanders, without changing their order. */
const wandering = (index: number): number => 40 + 40 * Math.sin(index / 5);

let player: SoundPlayer;
let heard: number[]; // samples
let begun: number[]; // RTP timestamps
let leftOut: number;
let lastMs: number; // until when frames were taken, in ms of both clocks

beforeEach(() => {
  player = createSoundPlayer(RATE, BLOCK_S);
  [heard, begun, leftOut, lastMs] = [[], [], 0, 1000];
});

/** Packet number `index` of a tone, as it comes at `ms`. */
function come(index: number, ms: number, stamp: number | null = 1): void {
  const time = (index * LENGTH) >>> 0;
  const samples = Float32Array.from(
    { length: LENGTH },
    (_, at) => LEVEL * Math.sin((2 * Math.PI * HZ * (index * LENGTH + at)) / RATE),
  );
  takePacket(player, { time, stamp, arrivedS: 500 + ms / 1000, gaveWay: 0, samples }, ms / 1000);
}

/** Plays until `ms`. */
function playUntil(ms: number): void {
  for (; lastMs + FRAME_S * 1000 <= ms; lastMs += FRAME_S * 1000) {
    heard.push(...nextFrame(player, lastMs / 1000));
    begun.push(...player.begun.splice(0));
    leftOut += player.leftOut;
    player.leftOut = 0;
  }
}

/** Packets `first` to before `end`, each `late` ms after its time, lost where that is undefined. Plays meanwhile. */
function stream(first: number, end: number, late: (index: number) => number | undefined): void {
  const arrivals = Array.from({ length: end - first }, (_, at) => first + at)
    .map((index) => [index, late(index)] as const)
    .filter((each): each is readonly [number, number] => each[1] !== undefined)
    .map(([index, ms]) => [index, 1000 + index * 20 + ms] as const)
    .sort((one, other) => one[1] - other[1]);
  for (const [index, ms] of arrivals) {
    playUntil(ms);
    come(index, ms);
  }
}

/** The steepest step from one sample heard to the next: a click is as steep as the sound is loud. */
function steepest(): number {
  return heard.reduce((most, sample, at) => Math.max(most, Math.abs(sample - (heard[at - 1] ?? sample))), 0);
}

/** Ms of silence after the first sound. */
function silentMs(): number {
  const first = heard.findIndex((sample) => sample !== 0);
  let [silent, run] = [0, 0];
  for (const sample of heard.slice(first)) {
    run = Math.abs(sample) < 1e-6 ? run + 1 : 0;
    if (run > 48) silent += run === 49 ? 49 : 1;
  }
  return (silent / RATE) * 1000;
}

/** How long ago what plays now began in the robot's time, in ms: it was captured when its packet was sent. */
function ageMs(): number {
  const next = player.queue.next ?? 0;
  return lastMs - 1000 - (next / RATE) * 1000;
}

describe("the player of sound", () => {
  it("begins some 20 ms after the first packet came, softly, and goes on without a hole or a click", () => {
    stream(0, 100, () => 0);
    expect(ageMs()).toBeGreaterThan(10);
    expect(ageMs()).toBeLessThan(35);
    expect(silentMs()).toBe(0);
    expect(steepest()).toBeLessThan(STEEPEST);
    expect(begun.slice(0, 3)).toEqual([0, LENGTH, 2 * LENGTH]);
    expect(leftOut).toBe(0);
  });

  it("has no hole once it waits as long as packets are late", () => {
    stream(0, 300, wandering);
    heard = [];
    const before = player.lead;
    stream(300, 600, wandering);
    expect(before).toBeGreaterThan(0.05);
    expect(steepest()).toBeLessThan(STEEPEST);
    expect(silentMs()).toBe(0);
    expect(begun.length).toBeGreaterThan(595);
  });

  it("plays faster without a click until no more waits than must, once the path is quiet", () => {
    stream(0, 300, wandering);
    const before = ageMs();
    stream(300, 900, () => 0);
    expect(before).toBeGreaterThan(70);
    expect(ageMs()).toBeLessThan(40);
    expect(steepest()).toBeLessThan(STEEPEST);
    expect(leftOut).toBe(0);
  });

  it("fills the place of a lost packet, and keeps time", () => {
    stream(0, 50, () => 0);
    const before = ageMs();
    stream(50, 100, (index) => (index === 60 ? undefined : 0));
    expect(silentMs()).toBe(0);
    expect(steepest()).toBeLessThan(STEEPEST);
    expect(Math.abs(ageMs() - before)).toBeLessThan(12);
    expect(begun).not.toContain(60 * LENGTH);
    expect(begun).toContain(61 * LENGTH);
  });

  it("falls silent where nothing comes any more, and then plays nothing", () => {
    stream(0, 50, () => 0);
    playUntil(lastMs + 500);
    expect(player.playing).toBeNull();
    expect(heard.slice(-LENGTH).every((sample) => sample === 0)).toBe(true);
    expect(steepest()).toBeLessThan(STEEPEST);
  });

  it("goes on after a long hole with the newest sound soon", () => {
    stream(0, 50, () => 0);
    stream(50, 200, (index) => (index < 100 ? undefined : 0));
    expect(ageMs()).toBeLessThan(40);
    expect(steepest()).toBeLessThan(STEEPEST);
  });

  it("plays what a stalled path held back, faster, and is soon on time again", () => {
    stream(0, 100, () => 0);
    stream(100, 700, (index) => (index < 110 ? (110 - index) * 20 : 0));
    expect(leftOut).toBe(0);
    expect(begun.length).toBeGreaterThan(690);
    expect(ageMs()).toBeLessThan(60);
  });

  it("takes packets out of order, twice, and too late", () => {
    stream(0, 20, (index) => (index % 2 === 0 ? 25 : 0));
    stream(20, 60, () => 0);
    come(58, lastMs);
    come(58, lastMs);
    come(30, lastMs);
    playUntil(lastMs + 5);
    expect(begun).toEqual([...begun].sort((one, other) => one - other));
    expect(new Set(begun).size).toBe(begun.length);
    expect(leftOut).toBe(1);
  });

  it("goes on where RTP timestamps wrap", () => {
    const wrap = Math.floor(0x1_0000_0000 / LENGTH);
    for (let index = wrap - 20; index < wrap + 20; index++) {
      const ms = 1000 + (index - wrap + 20) * 20;
      playUntil(ms);
      come(index, ms);
    }
    expect(begun.length).toBeGreaterThan(36);
    expect(silentMs()).toBe(0);
  });

  it("begins anew where RTP timestamps jump, as after a restart of the stream", () => {
    stream(0, 50, () => 0);
    for (let index = 0; index < 50; index++) {
      playUntil(2000 + index * 20);
      come(100_000 + index, 2000 + index * 20);
    }
    expect(begun.at(-1)).toBeGreaterThan(100_040 * LENGTH);
    expect(steepest()).toBeLessThan(STEEPEST);
  });

  it("goes on at once with what is within the tolerance where the next sound is too old", () => {
    player.context = { feedback: 10, tolerance: 2, gate: "event" };
    for (let index = 0; index < 10; index++) come(index, 1000, index < 6 ? 5 : 9);
    playUntil(1250);
    expect(begun[0]).toBe(6 * LENGTH);
    expect(leftOut).toBe(6);
  });

  it("leaves out sound that becomes too old while it waits, without a click", () => {
    player.context = { feedback: 5, tolerance: 2, gate: "event" };
    for (let index = 0; index < 10; index++) come(index, 1000 + index, index < 6 ? 5 : 9);
    playUntil(1050);
    player.context = { feedback: 9, tolerance: 2, gate: "event" };
    playUntil(1080);
    expect(begun).toContain(6 * LENGTH);
    expect(begun).not.toContain(5 * LENGTH);
    expect(steepest()).toBeLessThan(STEEPEST);
  });

  it("goes on in silence with sound that is too old while there is no other", () => {
    player.context = { feedback: 10, tolerance: 2, gate: "event" };
    for (let index = 0; index < 10; index++) come(index, 1000, 5);
    playUntil(1100);
    expect(begun.length).toBeGreaterThan(3);
    expect(Math.max(...heard.slice((FRAME_S + BLOCK_S) * RATE).map(Math.abs))).toBe(0);
  });

  it("falls silent within one frame of the feedback that makes its sound too old, and comes back without a click", () => {
    player.context = { feedback: 5, tolerance: 2, gate: "event" };
    for (let index = 0; index < 10; index++) come(index, 1000 + index, 5);
    playUntil(1050);
    const loud = heard.slice(-480).map(Math.abs);
    player.context = { feedback: 9, tolerance: 2, gate: "event" };
    playUntil(1060);
    expect(Math.max(...loud)).toBeGreaterThan(LEVEL / 2);
    expect(Math.max(...heard.slice(-240).map(Math.abs))).toBe(0);
    player.context = { feedback: 5, tolerance: 2, gate: "off" };
    playUntil(1090);
    expect(Math.max(...heard.slice(-240).map(Math.abs))).toBeGreaterThan(LEVEL / 2);
    expect(steepest()).toBeLessThan(STEEPEST);
  });

  it("begins again at once where sound that waits as long as packets were late would be too old", () => {
    stream(0, 300, (index) => 150 + 150 * Math.sin(index / 5));
    playUntil(7600); // nothing comes, and it falls silent
    [begun, leftOut] = [[], 0];
    for (let index = 330; index < 430; index++) {
      const ms = 1000 + index * 20;
      const event = Math.floor(ms / 40);
      playUntil(ms);
      judgeAgainst(player, { feedback: event, tolerance: 4, gate: "event" }, ms / 1000);
      come(index, ms, event);
    }
    expect(begun.length).toBeGreaterThan(85);
    expect(leftOut).toBeLessThan(5);
  });

  it("hurries while what plays is as old as the tolerance allows", () => {
    stream(0, 300, wandering);
    const before = ageMs();
    player.context = { feedback: 3, tolerance: 2, gate: "event" };
    stream(300, 320, () => 0);
    expect(before).toBeGreaterThan(70);
    expect(ageMs()).toBeLessThan(45);
  });

  it("hurries earlier where events come so fast that the next sound would be too old", () => {
    stream(0, 300, wandering);
    for (let event = 1; event <= 21; event++) {
      judgeAgainst(player, { feedback: event, tolerance: 22, gate: "event" }, lastMs / 1000 + event / 25);
    }
    stream(300, 302, () => 0); // 20 events behind
    expect(player.hurriesUntil).toBeGreaterThan(lastMs / 1000);
  });

  it("does not hurry at that gap where events come slowly", () => {
    stream(0, 300, wandering);
    for (let event = 1; event <= 21; event++) {
      judgeAgainst(player, { feedback: event, tolerance: 22, gate: "event" }, lastMs / 1000 + event / 2);
    }
    stream(300, 302, () => 0);
    expect(player.hurriesUntil).toBe(-Infinity);
  });

  it("keeps a bounded number of packets, the newest", () => {
    for (let index = 0; index < 200; index++) come(index, 200);
    expect(player.queue.packets.length).toBeLessThanOrEqual(50);
    expect(player.queue.packets.at(-1)?.time).toBe(199 * LENGTH);
  });

  it("ignores what comes while the sound device is opened", () => {
    come(0, 50);
    expect(player.queue.packets).toEqual([]);
  });

  it("waits longer where packets change their order", () => {
    stream(0, 300, (index) => (index * 7) % 60);
    begun = [];
    leftOut = 0;
    stream(300, 600, (index) => (index * 7) % 60);
    expect(leftOut).toBeLessThan(4);
    expect(begun.length).toBeGreaterThan(290);
  });

  it("says how much waits", () => {
    for (let index = 0; index < 5; index++) come(index, 1000 + index);
    expect(waitingMs(player)).toBe(0);
    playUntil(1030);
    expect(waitingMs(player)).toBeGreaterThan(20);
  });

  it.each([0.998, 1.002])(
    "keeps time with a sound device whose clock runs %f as fast as the robot's",
    (fast) => {
      const resampler = createSoundResampler();
      const output = new Float32Array(128);
      let [played, worst] = [0, 0];
      for (let index = 0; index < 5000; index++) {
        const atS = 1 + index * 0.02; // by the robot's clock
        while (1 + played / RATE < atS * fast) {
          const now = 1 + played / RATE;
          resample(resampler, output, playingRate(player, now), () => nextFrame(player, now));
          played += output.length;
        }
        const samples = new Float32Array(LENGTH).fill(0.1);
        takePacket(
          player,
          { time: index * LENGTH, stamp: 1, arrivedS: atS, gaveWay: 0, samples },
          1 + played / RATE,
        );
        if (index > 500) worst = Math.max(worst, Math.abs(player.lead - 0.02));
      }
      expect(worst).toBeLessThan(0.03);
      expect(player.leftOut).toBe(0);
    },
  );
});
