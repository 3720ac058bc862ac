/** Joins pieces of sound so that no click is heard. Lengths in samples. */

/** The length after which sound repeats itself best, and how well: 1 exactly, 0 not at all. */
export interface Period {
  readonly length: number;
  readonly likeness: number;
}

/** Steps of the first, coarse look at 16 kHz and above: a quarter of the samples is enough for it. */
const COARSE = 4;

/** From one to the other over the whole length. */
export function crossFade(from: Float32Array, to: Float32Array): Float32Array {
  return to.map((sample, at) => {
    const share = (at + 1) / (to.length + 1);
    return (from[at] ?? 0) * (1 - share) + sample * share;
  });
}

/** Between `least` and `most`, where `width` samples of `sound` from `at` are most like those that much later. */
export function findPeriod(
  sound: Float32Array,
  at: number,
  width: number,
  least: number,
  most: number,
  step = width >= 80 ? COARSE : 1,
): Period {
  let best: Period = { length: least, likeness: -1 };
  for (let length = least; length <= most; length += step) {
    const likeness = likenessOf(sound, at, at + length, width, step);
    if (likeness > best.likeness) best = { length, likeness };
  }
  if (step === 1) return best;
  const near = [Math.max(least, best.length - step), Math.min(most, best.length + step)] as const;
  return findPeriod(sound, at, width, ...near, 1);
}

function likenessOf(sound: Float32Array, one: number, other: number, width: number, step: number): number {
  let [both, first, second] = [0, 0, 0];
  for (let at = 0; at < width; at += step) {
    const [left, right] = [sound[one + at] ?? 0, sound[other + at] ?? 0];
    both += left * right;
    first += left * left;
    second += right * right;
  }
  const power = Math.sqrt(first * second);
  return power < QUIET * width ? 1 : both / power; // silence is like any other silence
}

/** −70 dBFS. */
const QUIET = 1e-7;
