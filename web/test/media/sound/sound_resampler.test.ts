import { describe, expect, it } from "vitest";
import { createSoundResampler, resample } from "../../../src/media/sound/sound_resampler";

const HZ = 440;

/** Frames of 40 samples of a tone at `rate`. */
function tone(rate: number): () => Float32Array {
  let from = 0;
  return () => Float32Array.from({ length: 40 }, () => Math.sin((2 * Math.PI * HZ * from++) / rate));
}

/** The largest error of a tone drawn from `rate` to `wanted`, after the first samples. */
function worst(rate: number, wanted: number, step = rate / wanted): number {
  const output = new Float32Array(4096);
  resample(createSoundResampler(), output, step, tone(rate));
  const errors = output.map((sample, at) => {
    const place = at * step - 3; // the first two samples of the input lie behind the four zeros
    return Math.abs(sample - Math.sin((2 * Math.PI * HZ * place) / rate));
  });
  return Math.max(...errors.subarray(64));
}

describe("sound at another rate", () => {
  it("is the same at its own rate", () => {
    expect(worst(48_000, 48_000)).toBeLessThan(1e-5);
  });

  it("is the same tone at the rate of another sound device", () => {
    expect(worst(48_000, 44_100)).toBeLessThan(1e-3);
    expect(worst(8000, 48_000)).toBeLessThan(0.02);
  });

  it("has no seam while it is played a few per mille faster", () => {
    expect(worst(48_000, 48_000, 1.005)).toBeLessThan(1e-3);
  });
});
