import { beforeEach, describe, expect, it } from "vitest";
import type { GateMode } from "../../src/gate/media_gate";
import { meanGap, type FrameMark, type GateContext } from "../../src/gate/gate_counters";
import { createSoundGate, observeSound as observe, type SoundGate } from "../../src/gate/sound_gate";

let gate: SoundGate;

beforeEach(() => {
  gate = createSoundGate();
});

function contextOf(feedback: number | null, mode: GateMode = "event"): GateContext {
  return { feedback, tolerance: 6, gate: mode, wallMs: 10_000 };
}

function observeSound(
  of: SoundGate,
  rtp: number,
  stamp: number | null | undefined,
  context: GateContext,
  audible: boolean,
  now: number,
  waiting = 0,
): boolean {
  const mark: FrameMark | undefined = stamp === undefined ? undefined : { stamp, capturedMs: 10_000 - rtp };
  return observe(of, rtp, mark, context, audible, now, waiting);
}

describe("the sound gate", () => {
  it("counts a segment once, by the verdict at its start", () => {
    expect(observeSound(gate, 960, 10, contextOf(10), true, 0)).toBe(true);
    expect(observeSound(gate, 960, 10, contextOf(16), true, 0)).toBe(true);
    expect(observeSound(gate, 960, 10, contextOf(17), true, 0)).toBe(false);
    expect(gate.counts).toMatchObject({ rendered: 1, discarded: 0, maxGap: 0, violations: 0 });
  });

  it("shuts for a segment that is too old, and counts it as discarded", () => {
    expect(observeSound(gate, 960, 3, contextOf(10), true, 0)).toBe(false);
    expect(gate.counts).toMatchObject({ rendered: 0, discarded: 1 });
  });

  it("shuts for a segment that overtook the feedback, and opens when that catches up", () => {
    expect(observeSound(gate, 960, 20, contextOf(10), true, 0)).toBe(false);
    expect(gate.counts.held).toBe(1);
    expect(observeSound(gate, 960, 20, contextOf(14), true, 0)).toBe(true);
    expect(gate.counts).toMatchObject({ held: 1, rendered: 0 });
  });

  it("stays shut while the stamp is unknown, and judges when it is known", () => {
    expect(observeSound(gate, 960, undefined, contextOf(10), true, 0)).toBe(false);
    expect(observeSound(gate, 960, 9, contextOf(10), true, 0)).toBe(true);
    expect(gate.counts).toMatchObject({ rendered: 1, stamp: 9, gap: 1 });
  });

  it("shuts for a segment without a stamp", () => {
    expect(observeSound(gate, 960, null, contextOf(10), true, 0)).toBe(false);
    expect(gate.counts.discarded).toBe(1);
  });

  it("renders nothing while sound is off", () => {
    observeSound(gate, 960, 10, contextOf(10), false, 0);
    expect(gate.counts).toMatchObject({ rendered: 0, discarded: 0, stamp: 10 });
  });

  it("shuts when no new segment comes, for what plays then is invented", () => {
    expect(observeSound(gate, 960, 10, contextOf(10), true, 1000)).toBe(true);
    expect(observeSound(gate, 960, 10, contextOf(10), true, 1199)).toBe(true);
    expect(observeSound(gate, 960, 10, contextOf(10), true, 1200)).toBe(false);
    expect(observeSound(gate, 1920, 10, contextOf(10), true, 1300)).toBe(true);
  });

  it("lets everything through while it is off", () => {
    expect(observeSound(gate, 960, undefined, contextOf(100, "off"), true, 0)).toBe(true);
    expect(observeSound(gate, 1920, 1, contextOf(100, "off"), true, 0)).toBe(true);
    expect(gate.counts).toMatchObject({ received: 2, rendered: 2, violations: 1 });
    expect(meanGap(gate.counts)).toBe(99);
    expect(meanGap(createSoundGate().counts)).toBeNull();
  });

  it("takes what waited while the browser opened its sound device for no lag, and does not let it be heard", () => {
    for (let now = 0; now < 2000; now += 20)
      expect(observeSound(gate, now, 1, contextOf(17), true, now, 900)).toBe(false);
    expect(gate.starting).toBe(true);
    expect(gate.counts).toMatchObject({ gap: null, lag: 0, received: 0, discarded: 0 });
    expect(observeSound(gate, 2000, 16, contextOf(17), true, 2000, 900)).toBe(true);
    expect(gate.starting).toBe(false);
    expect(observeSound(gate, 2020, 1, contextOf(17), true, 2020, 900)).toBe(false);
    expect(gate.counts).toMatchObject({ gap: 16, received: 2, rendered: 1, discarded: 1 });
  });

  it("counts what is too old from the first where nothing waits: that lag is the path's", () => {
    observeSound(gate, 960, 1, contextOf(17), true, 0, 100);
    expect(gate.starting).toBe(false);
    expect(gate.counts).toMatchObject({ gap: 16, discarded: 1 });
  });

  it("counts what is too old when the start does not end", () => {
    for (let now = 0; now <= 5000; now += 100) observeSound(gate, now, 1, contextOf(17), true, now, 900);
    expect(gate.starting).toBe(false);
    expect(gate.counts).toMatchObject({ gap: 16, discarded: 1 });
  });
});
