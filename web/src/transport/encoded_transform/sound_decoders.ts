import { SoundDecoder } from "./sound_decoder";
import type { SoundLeft, SoundRoute } from "./stamp_messages";

/** In the transform worker: which receivers' sound is decoded here, and where it goes. */
export class SoundDecoders {
  private readonly decoders = new Map<number, SoundDecoder>();
  private readonly browserPlays = new Set<number>(); // receivers

  constructor(private readonly failed: (receiver: number) => void) {}

  obey(order: SoundRoute | SoundLeft): void {
    const { receiver } = order;
    this.close(receiver);
    if ("browserPlays" in order) this.browserPlays.add(receiver);
    else if (order.port !== null) {
      this.decoders.set(receiver, new SoundDecoder(order.codec, order.port, () => this.fail(receiver)));
    }
  }

  /** Takes one packet of a receiver; false: it is for the browser's own decoder. */
  keep(receiver: number, time: number | undefined, stamp: number | null, data: ArrayBuffer): boolean {
    if (this.browserPlays.has(receiver)) return false;
    if (time !== undefined) this.decoders.get(receiver)?.take({ time, stamp, data }, performance.now());
    return true;
  }

  private fail(receiver: number): void {
    this.close(receiver);
    this.browserPlays.add(receiver);
    this.failed(receiver);
  }

  private close(receiver: number): void {
    this.decoders.get(receiver)?.close();
    this.decoders.delete(receiver);
  }
}
