/**
 * How unevenly packets come, and so how long sound waits before it plays. Times in s on a clock that loses none, RTP
 * timestamps in samples.
 */
export interface SoundJitter {
  readonly rate: number; // Hz, of RTP timestamps and samples
  latest: { readonly time: number; readonly arrivedS: number } | null; // the packet before
  late: number[]; // of the last packets, in order: s after the rhythm of their RTP timestamps, from any zero
  spread: number; // s between the earliest of them and the late ones that are waited for
}

/** Packets that are looked back on: five seconds. What was late before that says nothing of now. */
const WINDOW = 250;
/** Of so many packets none is to come too late to be played in time. */
const SHARE = 0.98;
const LEAST_S = 0.02;
/** Sound that waits longer belongs to another moment. */
const MOST_S = 0.4;

export function createSoundJitter(rate: number): SoundJitter {
  return { rate, latest: null, late: [], spread: 0 };
}

/** Notes one packet. Returns how much later it came than the earliest of those looked back on, in s. */
export function noteLateness(jitter: SoundJitter, time: number, arrivedS: number): number {
  const { latest, rate } = jitter;
  const before = jitter.late.at(-1) ?? 0;
  // RFC 3550 6.4.1: the difference of two packets' transit times; 32 bits, they wrap.
  const passed = latest === null ? 0 : arrivedS - latest.arrivedS - ((time - latest.time) | 0) / rate;
  const late = before + passed;
  jitter.latest = { time, arrivedS };
  jitter.late.push(late);
  if (jitter.late.length > WINDOW) jitter.late.shift();
  const sorted = [...jitter.late].sort((one, other) => one - other);
  const earliest = sorted[0] ?? late;
  jitter.spread = (sorted[Math.ceil(sorted.length * SHARE) - 1] ?? earliest) - earliest;
  return late - earliest;
}

/** How long sound waits that came as early as any. `blockS`: s that the sound device takes at once. */
export function targetS(jitter: SoundJitter, blockS: number): number {
  return Math.min(MOST_S, Math.max(LEAST_S, jitter.spread + blockS));
}
