import { describe, expect, it } from "vitest";
import { createLatency, noteCommandSent, notePicture, type Latency } from "../../src/drive/latency";
import { capHolds, capIsChoice, cappedShare, speedShare, viewDelay } from "../../src/drive/speed_cap";
import type { SpeedCapState } from "../../src/protocol/wire";
import { readVectors } from "../vectors";

const vectors = readVectors("speed_cap") as {
  readonly shares: readonly { readonly delay_ms: number | null; readonly share: number }[];
};

function console(mode: SpeedCapState["mode"], rest: Partial<SpeedCapState> = {}): SpeedCapState {
  return { type: "speed_cap", mode, holds: mode === "on", share: 1, delay_ms: null, why: "", ...rest };
}

/** Events 1 to `count`, 100 ms apart, each shown `delayMs` later. */
function shown(count: number, delayMs: number): Latency {
  const latency = createLatency();
  for (let event = 1; event <= count; event += 1) noteCommandSent(latency, event, event * 100);
  for (let event = 1; event <= count; event += 1) notePicture(latency, event, event * 100 + delayMs);
  return latency;
}

describe("the speed cap", () => {
  it.each(vectors.shares)(
    "leaves $share of the speed with a delay of $delay_ms ms",
    ({ delay_ms, share }) => {
      expect(speedShare(delay_ms)).toBeCloseTo(share);
    },
  );

  it("goes by the pictures of late", () => {
    const latency = shown(20, 30);
    expect(viewDelay(latency, 2100)).toBe(30);
    for (let event = 21; event < 40; event += 1) {
      noteCommandSent(latency, event, event * 100);
      notePicture(latency, event, event * 100 + 300);
    }
    expect(viewDelay(latency, 4200)).toBe(300);
  });

  it("does not know the delay before the first picture, nor long after the last", () => {
    expect(viewDelay(createLatency(), 0)).toBeNull();
    expect(viewDelay(shown(5, 30), 530 + 3000)).toBe(30);
    expect(viewDelay(shown(5, 30), 530 + 3001)).toBeNull();
  });

  it("counts the wait for a picture that does not come", () => {
    const latency = shown(5, 30);
    noteCommandSent(latency, 6, 600);
    expect(viewDelay(latency, 610)).toBe(30);
    expect(viewDelay(latency, 1500)).toBe(900);
  });

  it("is the operator's choice unless the console has decided", () => {
    expect([true, false].map((wanted) => capHolds(null, wanted))).toEqual([true, false]);
    expect([true, false].map((wanted) => capHolds(console("operator"), wanted))).toEqual([true, false]);
    expect([true, false].map((wanted) => capHolds(console("on"), wanted))).toEqual([true, true]);
    expect([true, false].map((wanted) => capHolds(console("off"), wanted))).toEqual([false, false]);
    expect([null, console("operator"), console("on"), console("off")].map(capIsChoice)).toEqual([
      true,
      true,
      false,
      false,
    ]);
  });

  it("takes the smaller share of its own and the console's", () => {
    expect(cappedShare(console("on", { share: 0.4 }), false, 250)).toBe(0.4);
    expect(cappedShare(console("on", { share: 0.9 }), false, 400)).toBe(0.5);
    expect(cappedShare(console("operator", { share: 0.1 }), true, 400)).toBe(0.5);
    expect(cappedShare(console("off"), true, 400)).toBe(1);
  });
});
