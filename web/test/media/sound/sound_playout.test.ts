import { beforeEach, describe, expect, it } from "vitest";
import {
  createSoundPlayout,
  goOn,
  hurry,
  isOpened,
  placeSegment,
  playingAt,
  type Place,
  type SoundPlayout,
} from "../../../src/media/sound/sound_playout";

const RATE = 48_000;
const LENGTH = 0.02; // s, of each packet

let playout: SoundPlayout;

beforeEach(() => {
  playout = createSoundPlayout(RATE);
});

/** Packet number `index` arrives at `now`. */
function arrive(index: number, now: number): Place | null {
  return placeSegment(playout, index * LENGTH * RATE, LENGTH, now, 100 + now);
}

/** Packets from `first` to before `end`, each `late` s behind its time. Returns how long each waits. */
function waits(first: number, end: number, late: (index: number) => number): number[] {
  const found: number[] = [];
  for (let index = first; index < end; index++) {
    const now = index * LENGTH + late(index);
    const place = arrive(index, now);
    if (place !== null) found.push(place.segment.start - now);
  }
  return found;
}

/** What share of sound is older than 240 ms when it plays, on a path whose delay wanders: 40 ms, now and then 250. */
function leftOut(hurries: boolean): number {
  const delayAt = (index: number): number => 0.04 + 0.21 * Math.max(0, Math.sin(index / 9)) ** 12;
  playout = createSoundPlayout(RATE);
  let [tooOld, last] = [0, 0];
  for (let index = 0; index < 2000; index++) {
    const now = Math.max(last, index * LENGTH + delayAt(index));
    last = now;
    const place = arrive(index, now);
    if (place === null || place.segment.start - index * LENGTH > 0.24) tooOld++;
    const playing = playingAt(playout, now);
    if (hurries && playing !== undefined && now - playing / RATE > 0.18) hurry(playout, 100 + now);
  }
  return tooOld / 2000;
}

describe("the playout of sound", () => {
  it("plays packets one behind the other, a little after they came", () => {
    const first = arrive(0, 0)?.segment;
    const second = arrive(1, LENGTH)?.segment;
    expect(first?.start).toBeCloseTo(0.02);
    expect(second?.start).toBe(first?.end);
    expect(playingAt(playout, 0.01)).toBeUndefined();
    expect(playingAt(playout, 0.03)).toBe(0);
    expect(playingAt(playout, 0.05)).toBe(LENGTH * RATE);
  });

  it("plays what comes too late at once, and lets what follows wait that much longer", () => {
    waits(0, 10, () => 0);
    const [late] = waits(10, 11, () => 0.1);
    expect(late).toBeCloseTo(0.02);
    expect(waits(11, 20, () => 0).at(-1)).toBeCloseTo(0.12);
  });

  it("has no hole once it waits as long as packets are late", () => {
    const late = (index: number): number => (index % 7) * 0.012;
    waits(0, 50, late);
    for (let index = 50; index < 500; index++) {
      const place = arrive(index, index * LENGTH + late(index));
      const before = playout.segments.at(-2);
      if (before !== undefined) expect(place?.segment.start).toBeCloseTo(before.end, 6);
      expect(place?.repeat).toBeNull();
    }
  });

  it("waits no longer than it must when the path has become quiet", () => {
    waits(0, 50, (index) => (index === 25 ? 0.2 : 0));
    expect(waits(50, 55, () => 0)[0]).toBeGreaterThan(0.15);
    expect(waits(55, 1500, () => 0).at(-1)).toBeLessThan(0.05);
  });

  it("waits for nothing that may come late while it hurries, and for a second only", () => {
    const late = (index: number): number => (index % 50 === 49 ? 0.2 : 0);
    const usual = waits(0, 200, late).slice(150, 199);
    expect(Math.min(...usual)).toBeGreaterThan(0.1);
    hurry(playout, 100 + 200 * LENGTH);
    expect(waits(200, 249, late).at(-1)).toBeLessThan(0.04);
    const after = waits(249, 400, late).slice(101, 150);
    expect(Math.min(...after)).toBeGreaterThan(0.1);
  });

  it("leaves out much less of a path that varies by more than the tolerance when it hurries", () => {
    const [usual, hurried] = [leftOut(false), leftOut(true)];
    expect(usual).toBeGreaterThan(0.1);
    expect(hurried).toBeLessThan(usual / 2);
  });

  it("plays on without a growing wait though the sound device loses a tenth of the time", () => {
    let longest = 0;
    for (let index = 0; index < 1500; index++) {
      const [now, arrivedS] = [index * LENGTH * 0.9, index * LENGTH];
      const place = placeSegment(playout, index * LENGTH * RATE, LENGTH, now, arrivedS);
      expect(place).not.toBeNull();
      longest = Math.max(longest, (place?.segment.start ?? 0) - now);
    }
    expect(longest).toBeLessThan(0.3);
  });

  it("never lets a packet wait for more than a second", () => {
    waits(0, 50, () => 0);
    const burst = waits(50, 150, (index) => (150 - index) * LENGTH);
    expect(Math.max(...burst)).toBeLessThan(1 + 1e-9);
    expect(waits(150, 200, () => 0).every((wait) => wait < 1 + 1e-9)).toBe(true);
  });

  it("fills the place of a lost packet with the one before it, and no longer hole", () => {
    waits(0, 10, () => 0);
    const place = arrive(11, 11 * LENGTH - 0.01);
    expect(place?.repeat).toMatchObject({ time: 9 * LENGTH * RATE });
    expect(place?.repeat?.end).toBe(place?.segment.start);
    expect((place?.repeat?.end ?? 0) - (place?.repeat?.start ?? 0)).toBeCloseTo(LENGTH);
    expect(arrive(20, 0.29)?.repeat).toBeNull();
  });

  it("keeps time over a wrap of the timestamps, and begins anew where they jump", () => {
    const last = 2 ** 32 - LENGTH * RATE;
    const first = placeSegment(playout, last, LENGTH, 5, 5)?.segment;
    expect(placeSegment(playout, 0, LENGTH, 5.02, 5.02)?.segment.start).toBe(first?.end);
    expect(placeSegment(playout, 12_345_678, LENGTH, 5.04, 5.04)?.segment.start).toBeCloseTo(5.06);
  });

  it("never plays two packets at once", () => {
    const late = (index: number): number => ((index * 7919) % 31) * 0.01;
    let end = 0;
    const arrivals = Array.from(
      { length: 400 },
      (_, index) => [index, index * LENGTH + late(index)] as const,
    );
    let newest = -1;
    for (const [index, now] of arrivals.toSorted(([, a], [, b]) => a - b)) {
      if (index <= newest) continue;
      newest = index;
      const place = arrive(index, now);
      if (place === null) continue;
      expect(place.repeat?.start ?? place.segment.start).toBeGreaterThanOrEqual(end - 1e-9);
      end = place.segment.end;
    }
  });
});

describe("going on with newer sound", () => {
  const passes =
    (from: number) =>
    (time: number): boolean =>
      time >= from * LENGTH * RATE;

  beforeEach(() => {
    for (let index = 0; index < 6; index++) arrive(index, 0.0001 * index); // a burst
  });

  it("leaves out what does not pass and plays the first that does at once", () => {
    const leftOut = goOn(playout, passes(3), 0.025);
    expect(leftOut.map(({ time }) => time / RATE / LENGTH)).toEqual([0, 1, 2]);
    expect(playingAt(playout, 0.025)).toBe(3 * LENGTH * RATE);
    const waiting = playout.segments.at(-1);
    expect(arrive(6, 0.03)?.segment.start).toBeCloseTo(waiting?.end ?? 0);
  });

  it("changes nothing where what plays passes, or nothing does", () => {
    const before = structuredClone(playout.segments);
    expect(goOn(playout, passes(0), 0.025)).toEqual([]);
    expect(goOn(playout, passes(9), 0.025)).toEqual([]);
    expect(playout.segments).toEqual(before);
  });
});

it("does not take a device for opened whose clock ran for one buffer", () => {
  expect(isOpened(0)).toBe(false);
  expect(isOpened(0.026)).toBe(false);
  expect(isOpened(2)).toBe(true);
});
