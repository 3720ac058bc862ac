import { createArrivals, noteArrival, type Arrivals } from "../../gate/sound_backlog";
import { createStampTable, noteMark, type StampTable } from "../../gate/stamp_table";
import type { FrameMark, SoundContext } from "../../gate/gate_counters";
import StampWorker from "./stamp_worker?worker&inline"; // a request of its own would cost a round trip
import {
  isFrameNote,
  isSoundFailure,
  type SoundOrder,
  type TransformOptions,
  type TransformTimes,
} from "./stamp_messages";

const BOOK_LIMIT = 512; // frames; over 8 s of the fastest stream

/** Stamps of one receiver's frames. */
export interface ReceiverStamps extends Arrivals {
  readonly table: StampTable;
  packets: boolean; // the page decodes and plays them, and not the browser
  onstamp: (() => void) | null;
  onframe: ((rtpTimestamp: number, times: TransformTimes) => void) | null; // of pictures, for their trace
  onfailed: (() => void) | null; // the page cannot decode them: the browser does, from now on
}

function createStamps(packets: boolean): ReceiverStamps {
  return {
    table: createStampTable(BOOK_LIMIT),
    packets,
    ...createArrivals(),
    onstamp: null,
    onframe: null,
    onfailed: null,
  };
}

function noteFrame(stamps: ReceiverStamps, rtpTimestamp: number, mark: FrameMark, dropped: boolean): void {
  noteMark(stamps.table, rtpTimestamp, mark);
  noteArrival(stamps, rtpTimestamp, dropped);
  stamps.onstamp?.();
}

/** WebCodecs and worklets, which are there on secure pages alone. */
function canPlayPackets(): boolean {
  return "AudioDecoder" in globalThis && "AudioWorkletNode" in globalThis;
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
    const packets = kind === "audio" && canPlayPackets();
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
    this.order(stamps, (receiver) => ({ receiver, before }));
  }

  /** Sends the decoded sound to an audio worklet; null: nowhere, for now. */
  route(stamps: ReceiverStamps, codec: string, port: MessagePort | null): void {
    this.order(stamps, (receiver) => ({ receiver, codec, port }), port === null ? [] : [port]);
  }

  /** Leaves this sound to the browser. */
  leave(stamps: ReceiverStamps): void {
    stamps.packets = false;
    this.order(stamps, (receiver) => ({ receiver, browserPlays: true }));
  }

  close(): void {
    this.receivers.clear();
    this.worker.terminate();
  }

  private order(
    stamps: ReceiverStamps,
    order: (receiver: number) => SoundOrder,
    transfer: Transferable[] = [],
  ): void {
    for (const [receiver, known] of this.receivers) {
      if (known === stamps) this.worker.postMessage(order(receiver), transfer);
    }
  }

  private note(data: unknown): void {
    if (isSoundFailure(data)) this.fail(data.failedReceiver);
    if (!isFrameNote(data)) return;
    const stamps = this.receivers.get(data.receiver);
    if (stamps === undefined) return;
    if (data.times !== null) stamps.onframe?.(data.rtpTimestamp, data.times);
    noteFrame(stamps, data.rtpTimestamp, data.mark, data.dropped);
  }

  private fail(receiver: number): void {
    const stamps = this.receivers.get(receiver);
    if (stamps === undefined) return;
    stamps.packets = false;
    stamps.onfailed?.();
  }
}
