import { describe, expect, it } from "vitest";
import { createRepeatTimer, repeatInterval, takeSample, waitAfter } from "../../src/drive/repeat_timer";
import { readVectors } from "../vectors";

interface RepeatVectors {
  initial_ms: number;
  intervals: { name: string; steps: { sample_ms: number; interval_ms: number }[] }[];
  backoff: { name: string; sample_ms: number; after_sends: number[]; waits_ms: number[] }[];
}

const vectors = readVectors("repeat") as RepeatVectors;

describe("the repeat timer", () => {
  it("starts with the initial interval", () => {
    expect(repeatInterval(createRepeatTimer())).toBe(vectors.initial_ms);
  });

  it.each(vectors.intervals)("$name", ({ steps }) => {
    const timer = createRepeatTimer();
    for (const { sample_ms, interval_ms } of steps) {
      takeSample(timer, sample_ms);
      expect(repeatInterval(timer)).toBeCloseTo(interval_ms, 5);
    }
  });

  it.each(vectors.backoff)("$name", ({ sample_ms, after_sends, waits_ms }) => {
    const timer = createRepeatTimer();
    takeSample(timer, sample_ms);
    expect(after_sends.map((sends) => waitAfter(timer, sends))).toEqual(waits_ms);
  });
});
