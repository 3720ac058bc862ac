import { rtpGap } from "../../gate/sound_backlog";
import { decodeMuLaw, opusChannels } from "./sound_samples";
import {
  createSoundPlayout,
  goOn,
  hurry,
  isOpened,
  placeSegment,
  playingAt,
  type Segment,
} from "./sound_playout";
import type { ReceiverStamps } from "../../transport/encoded_transform/stamp_reader";
import type { SoundSource } from "./sound_source";

const OPUS_RATE = 48_000;
const US_PER_TICK = 1_000_000 / OPUS_RATE;
const MU_LAW_RATE = 8000; // RFC 3551 4.5.14

interface Decoded {
  readonly buffer: AudioBuffer;
  readonly rate: number; // of playing it
  readonly fades: boolean;
}

/**
 * Sound that is decoded and played here, packet by packet: a browser's own buffer grows with every delay of a busy
 * machine, until what it plays is no longer within the tolerance.
 */
export class PacketSound implements SoundSource {
  readonly node: GainNode;
  private readonly playout;
  private readonly players = new Map<Segment, readonly [AudioBufferSourceNode, Decoded]>();
  private decoder: AudioDecoder | null = null;
  private newest: number | null = null; // RTP timestamp
  // RTP timestamps: decoders give one sound for each packet, with times of their own. Were one left out, what follows
  // would count as older than it is, never as newer.
  private decoding: number[] = [];

  constructor(
    private readonly stamps: ReceiverStamps,
    private readonly codec: string,
    private readonly context: AudioContext,
  ) {
    this.node = new GainNode(context);
    this.playout = createSoundPlayout(codec === "PCMU" ? MU_LAW_RATE : OPUS_RATE);
    stamps.onpacket = (time, packet) => this.take(time, new Uint8Array(packet));
  }

  playing(): number | undefined {
    return playingAt(this.playout, this.context.currentTime);
  }

  waiting(): number {
    const last = this.playout.segments.at(-1)?.end ?? 0;
    return Math.max(0, last - this.context.currentTime) * 1000;
  }

  catchUp(_playing: number, isTooOld: boolean, passes: (rtpTimestamp: number) => boolean): void {
    if (!isTooOld) return;
    const leftOut = goOn(this.playout, passes, this.context.currentTime);
    if (leftOut.length === 0) return;
    this.stamps.dropped += leftOut.length - 1; // the first was judged as it began
    const moved = [...this.players];
    this.players.clear();
    for (const [segment, [player, decoded]] of moved) {
      player.onended = null;
      player.disconnect();
      if (this.playout.segments.includes(segment)) this.start(segment, decoded);
    }
  }

  hurry(): void {
    hurry(this.playout, performance.now() / 1000);
  }

  leavesOut(): boolean {
    return false;
  }

  close(): void {
    this.stamps.onpacket = null;
    this.node.disconnect();
    if (this.decoder !== null && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = null;
  }

  /** One packet. What comes late or out of order is lost. */
  private take(time: number, packet: Uint8Array): void {
    if (this.newest !== null && rtpGap(time, this.newest) <= 0) return;
    this.newest = time;
    if (this.context.state !== "running" || !isOpened(this.context.currentTime)) return;
    if (this.codec === "PCMU") this.play(decodeMuLaw(packet), MU_LAW_RATE, time);
    else this.decode(packet, time);
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

  private play(samples: Float32Array<ArrayBuffer>, sampleRate: number, time: number): void {
    if (samples.length === 0) return;
    const buffer = new AudioBuffer({ length: samples.length, sampleRate });
    buffer.copyToChannel(samples, 0);
    const before = [...this.players.values()].at(-1)?.[1];
    const { currentTime } = this.context;
    const place = placeSegment(this.playout, time, buffer.duration, currentTime, performance.now() / 1000);
    if (place === null) {
      this.stamps.dropped += 1;
      return;
    }
    const { segment, rate, repeat } = place;
    if (repeat !== null && before !== undefined) this.start(repeat, { ...before, fades: true });
    this.start(segment, { buffer, rate, fades: false });
  }

  private start(segment: Segment, decoded: Decoded): void {
    const { context } = this;
    const { buffer, rate, fades } = decoded;
    const player = new AudioBufferSourceNode(context, { buffer, playbackRate: rate });
    player.connect(fades ? this.fading(segment) : this.node);
    player.onended = () => this.players.delete(segment);
    player.start(segment.start, 0, (segment.end - segment.start) * rate);
    this.players.set(segment, [player, decoded]);
  }

  private fading({ start, end }: Segment): GainNode {
    const fade = new GainNode(this.context);
    fade.gain.setValueAtTime(1, start);
    fade.gain.linearRampToValueAtTime(0, end);
    fade.connect(this.node);
    return fade;
  }
}
