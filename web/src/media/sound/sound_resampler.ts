/** Draws sound at another rate, through the last four samples (Catmull-Rom). Two samples late. */
export interface SoundResampler {
  readonly last: [number, number, number, number];
  at: number; // place between the second and the third: 0 to 1
  frame: Float32Array;
  read: number; // samples of `frame`
}

export function createSoundResampler(): SoundResampler {
  return { last: [0, 0, 0, 0], at: 0, frame: new Float32Array(0), read: 0 };
}

/** Fills `output`. `step`: samples of the input for each of the output; `next`: the next samples of the input. */
export function resample(
  resampler: SoundResampler,
  output: Float32Array,
  step: number,
  next: () => Float32Array,
): void {
  const { last } = resampler;
  for (let index = 0; index < output.length; index++) {
    output[index] = between(last, resampler.at);
    for (resampler.at += step; resampler.at >= 1; resampler.at -= 1) {
      last[0] = last[1];
      last[1] = last[2];
      last[2] = last[3];
      last[3] = nextSample(resampler, next);
    }
  }
}

function nextSample(resampler: SoundResampler, next: () => Float32Array): number {
  if (resampler.read >= resampler.frame.length) {
    resampler.frame = next();
    resampler.read = 0;
  }
  return resampler.frame[resampler.read++] ?? 0;
}

function between([a, b, c, d]: SoundResampler["last"], at: number): number {
  return b + (at / 2) * (c - a + at * (2 * a - 5 * b + 4 * c - d + at * (3 * (b - c) + d - a)));
}
