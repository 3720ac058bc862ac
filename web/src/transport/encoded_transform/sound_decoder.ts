/** In the transform worker: decodes the packets of one receiver and sends them to the audio worklet. */
import { decodeMuLaw, opusChannels } from "../../media/sound/sound_samples";
import type { SoundPacket } from "../../media/sound/sound_queue";

const OPUS_RATE = 48_000;
const US_PER_TICK = 1_000_000 / OPUS_RATE;
/** Packets on their way to the worklet that it has not taken yet; ... */
const MOST_SENT = 12;
/** ... of those that wait for it the newest, a second of the shortest that the console sends. */
const MOST_WAITING = 50;
/** Packets in the decoder, which gives one sound for each; with more it stands still. */
const MOST_DECODING = 50;
/** A decoder that fails so many times in a row, without any sound between, is of no use here. */
const MOST_FAILURES = 5;

export interface EncodedSound {
  readonly time: number; // RTP timestamp
  readonly stamp: number | null;
  readonly data: ArrayBuffer;
}

type Origin = Omit<SoundPacket, "samples" | "gaveWay">;
type Decoded = Omit<SoundPacket, "gaveWay">;

export class SoundDecoder {
  private decoder: AudioDecoder | null = null;
  // Decoders give one sound for each packet, with times of their own. Were one left out, what follows would count as
  // older than it is, never as newer.
  private decoding: Origin[] = [];
  private waiting: Decoded[] = [];
  private gaveWay = 0;
  private sent = 0;
  private failures = 0;

  /** `failed` is called once the browser does not decode this sound. */
  constructor(
    private readonly codec: string,
    private readonly port: MessagePort,
    private readonly failed: () => void,
  ) {
    port.onmessage = () => {
      this.sent -= 1;
      this.send();
    };
  }

  /** One packet, in the order of their arrival. */
  take({ time, stamp, data }: EncodedSound, nowMs: number): void {
    const origin = { time, stamp, arrivedS: nowMs / 1000 };
    if (this.codec === "PCMU") this.forward({ ...origin, samples: decodeMuLaw(new Uint8Array(data)) });
    else this.decode(data, origin);
  }

  close(): void {
    this.port.onmessage = null;
    this.port.close();
    if (this.decoder !== null && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = null;
  }

  private decode(data: ArrayBuffer, origin: Origin): void {
    if (data.byteLength === 0) return;
    if (this.decoding.length >= MOST_DECODING) {
      this.fail();
      return;
    }
    try {
      this.decoder = this.openDecoder(data);
      this.decoding.push(origin);
      const timestamp = Math.round(origin.time * US_PER_TICK);
      this.decoder.decode(new EncodedAudioChunk({ type: "key", timestamp, data }));
    } catch {
      this.fail();
    }
  }

  private openDecoder(data: ArrayBuffer): AudioDecoder {
    if (this.decoder !== null && this.decoder.state !== "closed") return this.decoder;
    this.decoding = [];
    const decoder = new AudioDecoder({
      output: (decoded) => this.decoded(decoded),
      error: () => this.fail(), // it is closed then; the next packet makes another
    });
    const numberOfChannels = opusChannels(new Uint8Array(data));
    decoder.configure({ codec: "opus", sampleRate: OPUS_RATE, numberOfChannels });
    return decoder;
  }

  private decoded(sound: AudioData): void {
    const samples = mixed(sound);
    sound.close();
    this.failures = 0;
    const origin = this.decoding.shift();
    if (origin !== undefined) this.forward({ ...origin, samples });
  }

  private fail(): void {
    if (this.decoder !== null && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = null;
    this.failures += 1;
    if (this.failures >= MOST_FAILURES) this.failed();
  }

  private forward(packet: Decoded): void {
    this.waiting.push(packet);
    if (this.waiting.length > MOST_WAITING) {
      this.waiting.shift();
      this.gaveWay += 1;
    }
    this.send();
  }

  private send(): void {
    while (this.sent < MOST_SENT) {
      const decoded = this.waiting.shift();
      if (decoded === undefined) return;
      const packet: SoundPacket = { ...decoded, gaveWay: this.gaveWay };
      this.gaveWay = 0;
      this.sent += 1;
      this.port.postMessage(packet, [packet.samples.buffer as ArrayBuffer]);
    }
  }
}

/** All channels together. */
function mixed(sound: AudioData): Float32Array {
  const all = new Float32Array(sound.numberOfFrames);
  const one = new Float32Array(sound.numberOfFrames);
  for (let planeIndex = 0; planeIndex < sound.numberOfChannels; planeIndex++) {
    sound.copyTo(one, { planeIndex, format: "f32-planar" });
    for (const [at, sample] of one.entries()) all[at] = (all[at] ?? 0) + sample / sound.numberOfChannels;
  }
  return all;
}
