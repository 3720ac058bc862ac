import { soundRuns, type ReplaySegment } from "./moment";
import { atRate, decodeMuLaw, opusChannels } from "../media/sound/sound_samples";

const OPUS_RATE = 48_000;
const MU_LAW_RATE = 8000; // RFC 3551 4.5.14

export interface DecodedSound {
  readonly samples: Float32Array<ArrayBuffer>; // of the first channel
  readonly rate: number;
}

/** The packets of a segment, also where their codec changes on the way; null: this browser cannot. */
export async function decodeSound(segment: ReplaySegment): Promise<DecodedSound | null> {
  const runs = await Promise.all(soundRuns(segment).map(decodeRun));
  const rate = Math.max(MU_LAW_RATE, ...runs.map((run) => run?.rate ?? 0));
  const parts: Float32Array<ArrayBuffer>[] = [];
  for (const run of runs) {
    if (run === null) return null;
    parts.push(atRate(run.samples, run.rate, rate));
  }
  return { samples: joined(parts), rate };
}

/** Packets of one codec. */
async function decodeRun({ packets, before }: ReplaySegment): Promise<DecodedSound | null> {
  const format = packets[0]?.format;
  if (format === "g711-ulaw")
    return { samples: joined(packets.map((each) => decodeMuLaw(each.payload))), rate: MU_LAW_RATE };
  if (format !== "opus" || !("AudioDecoder" in globalThis)) return null;
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
    for (const each of [...before, ...packets])
      decoder.decode(new EncodedAudioChunk({ type: "key", timestamp: each.captured, data: each.payload }));
    await decoder.flush();
  } catch {
    failed = true;
  }
  if (decoder.state !== "closed") decoder.close();
  if (failed) return null;
  const samples = joined(parts);
  const share = packets.length / (before.length + packets.length);
  return { samples: samples.slice(Math.round(samples.length * (1 - share))), rate: OPUS_RATE };
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
