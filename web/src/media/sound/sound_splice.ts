/** Joins pieces of sound so that no click is heard. Lengths in samples. */

/** The length after which sound repeats itself best, and how well: 1 exactly, 0 not at all. */
export interface Period {
  readonly length: number;
  readonly likeness: number;
}

/** Steps of the first, coarse look at 16 kHz and above: a quarter of the samples is enough for it. */
const COARSE = 4;
const COARSE_WIDTH = 80;
const NEARLY = 0.05;

/** From one to the other over the whole length. */
export function crossFade(from: Float32Array, to: Float32Array): Float32Array {
  return to.map((sample, at) => {
    const share = (at + 1) / (to.length + 1);
    return (from[at] ?? 0) * (1 - share) + sample * share;
  });
}

/**
 * Between `least` and `most`, where `width` samples of `sound` from its begin are most like those that much later; of
 * lengths that are nearly as good the longest, so that few joins do.
 */
export function findPeriod(sound: Float32Array, width: number, least: number, most: number): Period {
  const step = width >= COARSE_WIDTH ? COARSE : 1;
  const found = likenesses(sound, width, least, most, step);
  const best = Math.max(...found.map(({ likeness }) => likeness));
  const isPeak = (at: number, likeness: number): boolean =>
    likeness >= (found[at - 1]?.likeness ?? -1) && likeness >= (found[at + 1]?.likeness ?? -1);
  const good = ({ likeness }: Period, at: number): boolean =>
    likeness >= best - NEARLY && isPeak(at, likeness);
  const coarse = found.findLast(good) ?? { length: least, likeness: -1 };
  const [from, to] = [Math.max(least, coarse.length - step), Math.min(most, coarse.length + step)];
  return likenesses(sound, width, from, to, 1).reduce(
    (one, other) => (other.likeness > one.likeness ? other : one),
    coarse,
  );
}

function likenesses(sound: Float32Array, width: number, from: number, to: number, step: number): Period[] {
  const count = Math.floor((to - from) / step) + 1;
  return Array.from({ length: count }, (_, index) => {
    const length = from + index * step;
    return { length, likeness: likenessOf(sound, length, width, step) };
  });
}

function likenessOf(sound: Float32Array, later: number, width: number, step: number): number {
  let [both, first, second] = [0, 0, 0];
  for (let at = 0; at < width; at += step) {
    const [left, right] = [sound[at] ?? 0, sound[later + at] ?? 0];
    both += left * right;
    first += left * left;
    second += right * right;
  }
  const power = Math.sqrt(first * second);
  return power < QUIET * width ? 1 : both / power; // silence is like any other silence
}

/** −70 dBFS. */
const QUIET = 1e-7;
