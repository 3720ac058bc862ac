/** One packet, decoded. RTP timestamps of sound count its samples (RFC 7587 4.1, RFC 3551 4.5.14). */
export interface SoundPacket {
  readonly time: number; // RTP timestamp of its first sample
  readonly stamp: number | null; // event reference
  readonly arrivedS: number; // s on the clock of the thread that received it
  readonly gaveWay: number; // packets before it that the worklet did not take in time
  readonly samples: Float32Array;
}

/** Packets that wait, by their RTP timestamps. */
export interface SoundQueue {
  packets: SoundPacket[]; // the first may have begun to play
  next: number | null; // RTP timestamp of the sample that plays next; null: none has played
}

/** Why a packet does not wait. */
export type Unqueued = "late" | "again" | "not_sound";

/** Opus packets last 120 ms at most (RFC 6716 2.1.4), at 48 kHz. */
const MOST_SAMPLES = 5760;

export function createSoundQueue(): SoundQueue {
  return { packets: [], next: null };
}

/** `newer - older` of RTP timestamps: 32 bits, they wrap. */
export function samplesBetween(older: number, newer: number): number {
  return (newer - older) | 0;
}

/** Puts a packet where its RTP timestamp belongs; says why where it does not. */
export function enqueue(queue: SoundQueue, packet: SoundPacket): Unqueued | null {
  const { length } = packet.samples;
  if (length === 0 || length > MOST_SAMPLES) return "not_sound";
  if (queue.next !== null && samplesBetween(queue.next, packet.time) < 0) {
    return queue.packets.some(({ time }) => time === packet.time) ? "again" : "late";
  }
  const place = queue.packets.findIndex(({ time }) => samplesBetween(packet.time, time) >= 0);
  if (place >= 0 && queue.packets[place]?.time === packet.time) return "again";
  queue.packets.splice(place < 0 ? queue.packets.length : place, 0, packet);
  return null;
}

/** Samples that can be played on without a hole. */
export function unbroken(queue: SoundQueue): number {
  let end = queue.next;
  if (end === null) return 0;
  const from = end;
  for (const { time, samples } of queue.packets) {
    if (samplesBetween(end, time) > 0) break;
    if (samplesBetween(end, time) + samples.length > 0) end = (time + samples.length) >>> 0;
  }
  return Math.max(0, samplesBetween(from, end));
}

/** Samples missing before the first packet; null where none waits. */
export function hole(queue: SoundQueue): number | null {
  const first = queue.packets[0];
  if (first === undefined || queue.next === null) return null;
  return Math.max(0, samplesBetween(queue.next, first.time));
}

/** The next samples after `offset`, without taking them. Ask for no more than is unbroken. */
export function peek(queue: SoundQueue, offset: number, length: number): Float32Array {
  const found = new Float32Array(length);
  if (queue.next === null) return found;
  for (const { time, samples } of queue.packets) {
    const at = samplesBetween(queue.next, time) - offset; // of its first sample in what is found
    if (at >= length) break;
    if (at + samples.length <= 0) continue;
    const from = Math.max(0, -at);
    found.set(samples.subarray(from, from + length - Math.max(0, at)), Math.max(0, at));
  }
  return found;
}

/** Goes on by `length` samples. Returns the packets that ended before. */
export function advance(queue: SoundQueue, length: number): SoundPacket[] {
  if (queue.next === null) return [];
  queue.next = (queue.next + length) >>> 0;
  const { next } = queue;
  const first = queue.packets.findIndex(
    ({ time, samples }) => samplesBetween(next, time) + samples.length > 0,
  );
  return queue.packets.splice(0, first < 0 ? queue.packets.length : first);
}

/** The packet that plays next or goes on playing. */
export function current(queue: SoundQueue): SoundPacket | null {
  const first = queue.packets[0];
  if (first === undefined || queue.next === null || samplesBetween(queue.next, first.time) > 0) return null;
  return first;
}
