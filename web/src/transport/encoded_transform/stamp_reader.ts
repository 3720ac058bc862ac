import { createArrivals, noteArrival, type Arrivals } from "../../gate/sound_backlog";
import { createStampTable, noteMark, type StampTable } from "../../gate/stamp_table";
import type { FrameMark } from "../../gate/gate_counters";
import StampWorker from "./stamp_worker?worker&inline"; // a request of its own would cost a round trip
import {
  isFrameNote,
  type SoundContext,
  type SoundSkip,
  type TransformOptions,
  type TransformTimes,
} from "./stamp_messages";

const BOOK_LIMIT = 512; // frames; over 8 s of the fastest stream

/** Stamps of one receiver's frames. */
export interface ReceiverStamps extends Arrivals {
  readonly table: StampTable;
  readonly packets: boolean; // its packets go to `onpacket`, not to the browser's decoder
  onstamp: (() => void) | null;
  onpacket: ((rtpTimestamp: number, packet: ArrayBuffer) => void) | null;
  onframe: ((rtpTimestamp: number, times: TransformTimes) => void) | null; // of pictures, for their trace
}

function createStamps(packets: boolean): ReceiverStamps {
  return {
    table: createStampTable(BOOK_LIMIT),
    packets,
    ...createArrivals(),
    onstamp: null,
    onpacket: null,
    onframe: null,
  };
}

/** A frame came; `packet` is null where the page does not decode it. */
function notePacket(
  stamps: ReceiverStamps,
  rtpTimestamp: number,
  mark: FrameMark,
  dropped: boolean,
  packet: ArrayBuffer | null,
): void {
  noteMark(stamps.table, rtpTimestamp, mark);
  noteArrival(stamps, rtpTimestamp, dropped);
  stamps.onstamp?.();
  if (packet !== null) stamps.onpacket?.(rtpTimestamp, packet);
}

/** null where the browser has no transforms: no picture passes the gate there. */
export function newReader(): StampReader | null {
  return StampReader.isSupported() ? new StampReader() : null;
}

/** Owns the transform worker, for all receivers of the page. */
export class StampReader {
  private readonly worker = new StampWorker();
  private readonly receivers = new Map<number, ReceiverStamps>();
  private nextReceiver = 1;

  constructor() {
    this.worker.onmessage = (event: MessageEvent<unknown>) => this.note(event.data);
  }

  static isSupported(): boolean {
    return "RTCRtpScriptTransform" in globalThis && "transform" in RTCRtpReceiver.prototype;
  }

  /** Puts the transform in front of a receiver's decoder. Call before the first frame arrives. */
  attach(receiver: RTCRtpReceiver, kind: "audio" | "video", trailer: boolean): ReceiverStamps {
    const packets = kind === "audio" && "AudioDecoder" in globalThis;
    const options: TransformOptions = { receiver: this.nextReceiver++, kind, trailer, packets };
    const stamps = createStamps(packets);
    this.receivers.set(options.receiver, stamps);
    receiver.transform = new RTCRtpScriptTransform(this.worker, options);
    return stamps;
  }

  detach(stamps: ReceiverStamps): void {
    for (const [receiver, known] of this.receivers) if (known === stamps) this.receivers.delete(receiver);
  }

  tell(context: SoundContext): void {
    this.worker.postMessage(context);
  }

  /** Leaves out sound that is older than the RTP timestamp `before`, before it is decoded. */
  skip(stamps: ReceiverStamps, before: number): void {
    for (const [receiver, known] of this.receivers) {
      const order: SoundSkip = { receiver, before };
      if (known === stamps) this.worker.postMessage(order);
    }
  }

  close(): void {
    this.receivers.clear();
    this.worker.terminate();
  }

  private note(data: unknown): void {
    if (!isFrameNote(data)) return;
    const stamps = this.receivers.get(data.receiver);
    if (stamps === undefined) return;
    if (data.times !== null) stamps.onframe?.(data.rtpTimestamp, data.times);
    notePacket(stamps, data.rtpTimestamp, data.mark, data.dropped, data.packet);
  }
}
