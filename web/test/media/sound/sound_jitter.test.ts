import { describe, expect, it } from "vitest";
import {
  createSoundJitter,
  noteLateness,
  targetS,
  type SoundJitter,
} from "../../../src/media/sound/sound_jitter";

const RATE = 48_000;
const LENGTH = 960; // samples of a packet, 20 ms
const BLOCK_S = 0.01;

/** Packets `first` to before `end`, each `late(index)` s after its time. */
function come(jitter: SoundJitter, first: number, end: number, late: (index: number) => number): void {
  for (let index = first; index < end; index++) {
    noteLateness(jitter, (index * LENGTH) >>> 0, index * 0.02 + late(index));
  }
}

describe("the wait of sound", () => {
  it("is as short as it may be where packets come evenly", () => {
    const jitter = createSoundJitter(RATE);
    come(jitter, 0, 300, () => 0.1);
    expect(targetS(jitter, BLOCK_S)).toBeCloseTo(0.02);
  });

  it("grows with the lateness of packets, and by a block of the sound device", () => {
    const jitter = createSoundJitter(RATE);
    come(jitter, 0, 300, (index) => (index % 4) * 0.02);
    expect(targetS(jitter, BLOCK_S)).toBeCloseTo(0.07);
  });

  it("shrinks again five seconds after the path has become quiet", () => {
    const jitter = createSoundJitter(RATE);
    come(jitter, 0, 300, (index) => (index % 4) * 0.02);
    come(jitter, 300, 600, () => 0);
    expect(targetS(jitter, BLOCK_S)).toBeCloseTo(0.02);
  });

  it("is not that of a single late packet", () => {
    const jitter = createSoundJitter(RATE);
    come(jitter, 0, 300, (index) => (index === 200 ? 0.2 : 0));
    expect(targetS(jitter, BLOCK_S)).toBeCloseTo(0.02);
  });

  it("is never longer than four tenths of a second", () => {
    const jitter = createSoundJitter(RATE);
    come(jitter, 0, 300, (index) => (index % 10) * 0.2);
    expect(targetS(jitter, BLOCK_S)).toBeCloseTo(0.4);
  });

  it("goes on where RTP timestamps wrap", () => {
    const jitter = createSoundJitter(RATE);
    const wrap = Math.floor(0x1_0000_0000 / LENGTH);
    come(jitter, wrap - 100, wrap + 100, () => 0);
    expect(targetS(jitter, BLOCK_S)).toBeCloseTo(0.02);
  });

  it("does not follow clocks that drift apart", () => {
    const jitter = createSoundJitter(RATE);
    come(jitter, 0, 10_000, (index) => index * 0.02 * 0.0005);
    expect(targetS(jitter, BLOCK_S)).toBeCloseTo(0.02, 2);
    expect(jitter.late.length).toBeLessThan(1000);
  });

  it("says how much later a packet came than the earliest", () => {
    const jitter = createSoundJitter(RATE);
    come(jitter, 0, 10, () => 0.05);
    expect(noteLateness(jitter, 10 * LENGTH, 10 * 0.02 + 0.08)).toBeCloseTo(0.03);
  });
});
