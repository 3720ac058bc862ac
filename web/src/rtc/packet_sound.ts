import { decodeMuLaw, opusChannels } from "../core/sound_packets";
import { splitTrailer } from "../core/trailer";
import { UNMARKED, type FrameMark } from "../core/medium_counts";
import { createStampBook, noteMark } from "../core/stamp_book";
import { createArrivals, rtpGap } from "../core/sound_backlog";
import type { PacketPlayer, Section } from "./section";
import type { ReceiverStamps } from "./stamp_reader";

const OPUS_RATE = 48_000;
const US_PER_TICK = 1_000_000 / OPUS_RATE;
const MU_LAW_RATE = 8000; // RFC 3551 4.5.14
const LEAD_S = 0.02; // that a packet may come late
const MOST_AHEAD_S = 0.3; // more than that waits for nothing
const BOOK_LIMIT = 512; // packets

interface Segment {
  readonly time: number; // RTP timestamp
  readonly start: number; // s, on the context's clock
  readonly end: number;
}

/** Sound whose encoded packets come one by one, each with its trailer: decoded and played here. */
export class PacketSound implements Section, PacketPlayer {
  readonly kind = "audio";
  readonly source = this;
  readonly stamps: ReceiverStamps = {
    book: createStampBook(BOOK_LIMIT),
    ...createArrivals(),
    onstamp: null,
  };
  private context: AudioContext | null = null; // null before somebody listens
  private output: GainNode | null = null;
  private decoder: AudioDecoder | null = null;
  private segments: Segment[] = [];
  // RTP timestamps: decoders give one sound for each packet, with times of their own. Were one left out, what follows
  // would count as older than it is, never as newer.
  private decoding: number[] = [];

  constructor(private readonly codec: string) {}

  /** Whether this browser can decode it. */
  static canPlay(codec: string): boolean {
    return codec === "PCMU" || "AudioDecoder" in globalThis;
  }

  connect(context: AudioContext): AudioNode {
    this.context = context;
    this.output = new GainNode(context);
    return this.output;
  }

  /** One packet. What comes late or out of order is lost. */
  take(time: number, data: Uint8Array): void {
    const { stamps } = this;
    if (stamps.newest !== null && rtpGap(time, stamps.newest) <= 0) return;
    const { length, trailer } = splitTrailer(data);
    noteMark(stamps.book, time, trailer === null ? UNMARKED : markOf(trailer));
    stamps.newest = time;
    stamps.onstamp?.();
    const packet = data.slice(0, length);
    if (this.context?.state !== "running") return;
    if (this.codec === "PCMU") this.play(decodeMuLaw(packet), MU_LAW_RATE, time);
    else this.decode(packet, time);
  }

  playing(): number | undefined {
    const now = this.context?.currentTime ?? 0;
    return this.segments.find((segment) => segment.start <= now && now < segment.end)?.time;
  }

  close(): void {
    this.output?.disconnect();
    if (this.decoder !== null && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = null;
    this.context = null;
  }

  private decode(packet: Uint8Array, time: number): void {
    if (this.decoder === null || this.decoder.state === "closed") {
      this.decoding = [];
      this.decoder = new AudioDecoder({
        output: (decoded) => this.decoded(decoded),
        error: () => undefined, // it is closed then; the next packet makes another
      });
      const numberOfChannels = opusChannels(packet);
      this.decoder.configure({ codec: "opus", sampleRate: OPUS_RATE, numberOfChannels });
    }
    const timestamp = Math.round(time * US_PER_TICK);
    this.decoding.push(time);
    this.decoder.decode(new EncodedAudioChunk({ type: "key", timestamp, data: packet }));
  }

  private decoded(data: AudioData): void {
    const samples = new Float32Array(data.numberOfFrames);
    data.copyTo(samples, { planeIndex: 0, format: "f32-planar" });
    const time = this.decoding.shift();
    if (time !== undefined) this.play(samples, data.sampleRate, time);
    data.close();
  }

  /** Behind what waits already; silence in between where nothing does. */
  private play(samples: Float32Array<ArrayBuffer>, rate: number, time: number): void {
    if (this.context === null || this.output === null || samples.length === 0) return;
    const now = this.context.currentTime;
    this.segments = this.segments.filter((segment) => segment.end > now);
    const last = this.segments.at(-1)?.end ?? now + LEAD_S;
    if (last > now + MOST_AHEAD_S) {
      this.stamps.dropped += 1;
      return;
    }
    const buffer = new AudioBuffer({ length: samples.length, sampleRate: rate });
    buffer.copyToChannel(samples, 0);
    const node = new AudioBufferSourceNode(this.context, { buffer });
    node.connect(this.output);
    node.start(last);
    this.stamps.queued = time;
    this.segments.push({ time, start: last, end: last + buffer.duration });
  }
}

function markOf(trailer: { event: number | null; captureTimeUs: bigint | null }): FrameMark {
  const { event, captureTimeUs } = trailer;
  return { stamp: event, capturedMs: captureTimeUs === null ? null : Number(captureTimeUs) / 1000 };
}
