import { avcCodec } from "../media/h264";
import type { ReplayRecord } from "./chunk";
import type { ReplayPicture } from "./moment";

const PATIENCE_MS = 250; // for a decoder that gives a picture only when pressed

const VP8 = "vp8";
const USUAL = "avc1.42C01F"; // constrained baseline, as the console encodes

/** Why there is no picture. */
export class CannotDecode extends Error {}

/** Browsers take a while to start their first decoder: this lets them, while the recording is asked for. */
export function startDecoders(): void {
  if ("VideoDecoder" in globalThis) VideoDecoder.isConfigSupported(configOf(USUAL)).catch(() => undefined);
}

/** Decodes the pictures of one camera, exactly the one that was asked for. */
export class PictureDecoder {
  private decoder: VideoDecoder | null = null;
  private codec = "";
  private fed: number | null = null; // id of the newest record that the decoder has seen
  private shown: VideoFrame | null = null;
  private waiting: { id: number; done: (frame: VideoFrame) => void; failed: (error: Error) => void } | null =
    null;

  /** The picture itself; it stays this object's. One call at a time. Raises CannotDecode. */
  async decode(picture: ReplayPicture): Promise<VideoFrame> {
    const { record, sequence } = picture;
    if (this.shown?.timestamp === record.id) return this.shown;
    const decoder = await this.ready(sequence);
    const seen = this.fed === null ? -1 : sequence.findIndex((each) => each.id === this.fed);
    const continues = seen !== -1 && seen < sequence.length - 1;
    if (!continues) this.restart(decoder);
    const found = this.next(record.id);
    for (const each of continues ? sequence.slice(seen + 1) : sequence) this.feed(decoder, each);
    const pressed = setTimeout(() => this.press(decoder), PATIENCE_MS);
    try {
      const frame = await found;
      this.shown?.close();
      this.shown = frame;
      return frame;
    } finally {
      clearTimeout(pressed);
      this.waiting = null;
    }
  }

  close(): void {
    if (this.decoder !== null && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = null;
    this.waiting?.failed(new CannotDecode("closed"));
    this.shown?.close();
    this.shown = null;
  }

  private next(id: number): Promise<VideoFrame> {
    return new Promise((done, failed) => (this.waiting = { id, done, failed }));
  }

  private async ready(sequence: readonly ReplayRecord[]): Promise<VideoDecoder> {
    if (!("VideoDecoder" in globalThis)) throw new CannotDecode(withoutDecoder());
    const codec = codecOf(sequence[0]);
    if (codec === null) throw new CannotDecode("The recording does not say how this picture was encoded");
    if (this.decoder?.state === "configured" && codec === this.codec) return this.decoder;
    const { supported } = await VideoDecoder.isConfigSupported(configOf(codec));
    if (supported !== true)
      throw new CannotDecode(`This browser cannot decode ${codec === VP8 ? "VP8" : "H.264"}`);
    if (this.decoder !== null && this.decoder.state !== "closed") this.decoder.close();
    this.codec = codec;
    this.fed = null;
    this.decoder = new VideoDecoder({
      output: (frame) => this.take(frame),
      error: (error) =>
        this.waiting?.failed(new CannotDecode(`The picture cannot be decoded: ${error.message}`)),
    });
    this.decoder.configure(configOf(codec));
    return this.decoder;
  }

  private restart(decoder: VideoDecoder): void {
    decoder.reset();
    decoder.configure(configOf(this.codec));
    this.fed = null;
  }

  private feed(decoder: VideoDecoder, record: ReplayRecord): void {
    const type = record.keyframe ? "key" : "delta";
    decoder.decode(new EncodedVideoChunk({ type, timestamp: record.id, data: record.payload }));
    this.fed = record.id;
  }

  /** After it only a keyframe is taken. */
  private press(decoder: VideoDecoder): void {
    this.fed = null;
    decoder.flush().then(
      () => this.waiting?.failed(new CannotDecode("The picture cannot be decoded")),
      () => undefined, // the decoder's own error says it
    );
  }

  private take(frame: VideoFrame): void {
    if (frame.timestamp === this.waiting?.id) this.waiting.done(frame);
    else frame.close();
  }
}

/** Of what begins with this record; it changes at keyframes only. Null: it does not say. */
function codecOf(first: ReplayRecord | undefined): string | null {
  if (first === undefined) return null;
  return first.format === "vp8" ? VP8 : avcCodec(first.payload);
}

/** H.264 is Annex B: the parameter sets stand in front of each keyframe. */
function configOf(codec: string): VideoDecoderConfig {
  return { codec, optimizeForLatency: true, hardwareAcceleration: "prefer-software" };
}

function withoutDecoder(): string {
  return isSecureContext
    ? "This browser has no WebCodecs, which the pictures need. Use Chromium, Chrome, Edge, Safari or Firefox 130 or newer"
    : "Browsers decode recordings only on pages that come over HTTPS or from this computer itself";
}
