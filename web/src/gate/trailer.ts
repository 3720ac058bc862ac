import { UNMARKED, type FrameMark } from "./gate_counters";
import { isEvent } from "./serial";

/**
 * The trailer behind an encoded frame, in LiveKit's published frame-metadata layout: TLVs (every byte XOR 0xFF),
 * then the trailer's length XOR 0xFF, then "LKTS".
 */
export interface Trailer {
  readonly event: number | null; // null when it carries no valid reference
  readonly captureTimeUs: bigint | null;
}

export interface SplitFrame {
  readonly length: number; // bytes of the payload, without the trailer
  readonly trailer: Trailer | null; // null without a well-formed one
}

/** What a frame says by its trailer. */
export function markOfTrailer(trailer: Trailer | null): FrameMark {
  if (trailer === null) return UNMARKED;
  const microseconds = trailer.captureTimeUs;
  return { stamp: trailer.event, capturedMs: microseconds === null ? null : Number(microseconds) / 1000 };
}

const MAGIC = [0x4c, 0x4b, 0x54, 0x53]; // "LKTS"
const TAIL_LENGTH = 5; // the length byte and the magic
const TAG_CAPTURE_TIME = 1;
const TAG_FRAME_ID = 2;

export function splitTrailer(data: Uint8Array): SplitFrame {
  const whole: SplitFrame = { length: data.length, trailer: null };
  if (data.length < TAIL_LENGTH || !endsWithMagic(data)) return whole;
  const length = byteAt(data, data.length - TAIL_LENGTH) ^ 0xff;
  if (length < TAIL_LENGTH || length > data.length) return whole;
  const start = data.length - length;
  const trailer = readTlvs(data.slice(start, data.length - TAIL_LENGTH).map((byte) => byte ^ 0xff));
  return trailer === null ? whole : { length: start, trailer };
}

function endsWithMagic(data: Uint8Array): boolean {
  return MAGIC.every((byte, index) => data[data.length - MAGIC.length + index] === byte);
}

function readTlvs(tlvs: Uint8Array): Trailer | null {
  const view = new DataView(tlvs.buffer, tlvs.byteOffset, tlvs.length);
  let event: number | null = null;
  let captureTimeUs: bigint | null = null;
  let position = 0;
  while (position < tlvs.length) {
    if (position + 2 > tlvs.length) return null;
    const [tag, size, value] = [byteAt(tlvs, position), byteAt(tlvs, position + 1), position + 2];
    position = value + size;
    if (position > tlvs.length) return null;
    if (tag === TAG_FRAME_ID) event = size === 4 ? eventOf(view.getUint32(value)) : null;
    else if (tag === TAG_CAPTURE_TIME && size === 8) captureTimeUs = view.getBigUint64(value);
  }
  return { event, captureTimeUs };
}

function eventOf(value: number): number | null {
  return isEvent(value) ? value : null;
}

function byteAt(data: Uint8Array, index: number): number {
  return data[index] ?? 0;
}
