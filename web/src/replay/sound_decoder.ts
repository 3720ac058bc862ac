import type { ReplayRecord } from "../core/replay_chunk";
import { decodeMuLaw, opusChannels } from "../core/sound_packets";

const OPUS_RATE = 48_000;
const MU_LAW_RATE = 8000; // RFC 3551 4.5.14

export interface DecodedSound {
  readonly samples: Float32Array<ArrayBuffer>; // of the first channel
  readonly rate: number;
}

/** Whether this browser can decode what a recording says of its sound. */
export function canHear(encoding: string): boolean {
  return encoding === "g711-ulaw" || "AudioDecoder" in globalThis;
}

/** Packets that follow each other; null: this browser cannot. */
export async function decodeSound(
  packets: readonly ReplayRecord[],
  isOpus: boolean,
): Promise<DecodedSound | null> {
  if (packets.length === 0) return { samples: new Float32Array(0), rate: OPUS_RATE };
  if (!isOpus)
    return { samples: joined(packets.map((each) => decodeMuLaw(each.payload))), rate: MU_LAW_RATE };
  if (!("AudioDecoder" in globalThis)) return null;
  const parts: Float32Array<ArrayBuffer>[] = [];
  let failed = false;
  const decoder = new AudioDecoder({
    output: (data) => {
      const part = new Float32Array(data.numberOfFrames);
      data.copyTo(part, { planeIndex: 0, format: "f32-planar" });
      data.close();
      parts.push(part);
    },
    error: () => (failed = true),
  });
  try {
    const channels = opusChannels(packets[0]?.payload ?? new Uint8Array(0));
    decoder.configure({ codec: "opus", sampleRate: OPUS_RATE, numberOfChannels: channels });
    for (const each of packets)
      decoder.decode(new EncodedAudioChunk({ type: "key", timestamp: each.captured, data: each.payload }));
    await decoder.flush();
  } catch {
    failed = true;
  }
  if (decoder.state !== "closed") decoder.close();
  return failed ? null : { samples: joined(parts), rate: OPUS_RATE };
}

function joined(parts: readonly Float32Array<ArrayBuffer>[]): Float32Array<ArrayBuffer> {
  const whole = new Float32Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}
