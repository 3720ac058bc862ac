/** Transform worker: reads the stamp of every encoded frame before it is decoded, and takes the trailer off. */
import { eventOfOffset } from "../../gate/capture_time";
import { judge } from "../../gate/media_gate";
import type { FrameMark, SoundContext } from "../../gate/gate_counters";
import { rtpGap } from "../../gate/sound_backlog";
import { markOfTrailer, splitTrailer } from "../../gate/trailer";
import { SoundDecoders } from "./sound_decoders";
import type { FrameNote, SoundFailure, SoundOrder, TransformOptions, TransformTimes } from "./stamp_messages";

interface EncodedFrame {
  data: ArrayBuffer;
  getMetadata(): {
    rtpTimestamp?: number;
    senderCaptureTimeOffset?: number;
    captureTime?: number;
    receiveTime?: number;
  };
}

interface Transformer {
  readonly options: TransformOptions;
  readonly readable: ReadableStream<EncodedFrame>;
  readonly writable: WritableStream<EncodedFrame>;
}

interface TransformScope {
  onrtctransform: ((event: { readonly transformer: Transformer }) => void) | null;
  onmessage: ((event: MessageEvent<SoundContext | SoundOrder>) => void) | null;
  postMessage(note: FrameNote | SoundFailure): void;
}

const scope = self as unknown as TransformScope;
let context: SoundContext = { feedback: null, tolerance: 0, gate: "event" };
const skips = new Map<number, number>(); // receiver -> RTP timestamp before which its sound is left out
const sounds = new SoundDecoders((failedReceiver) => scope.postMessage({ failedReceiver }));

scope.onmessage = ({ data }) => {
  if (!("receiver" in data)) context = data;
  else if ("before" in data) skips.set(data.receiver, data.before);
  else sounds.obey(data);
};

scope.onrtctransform = ({ transformer }) => {
  const { options } = transformer;
  const stamping = new TransformStream<EncodedFrame, EncodedFrame>({
    transform(frame, controller) {
      if (passes(frame, options)) controller.enqueue(frame);
    },
  });
  // The pipe ends with the receiver; there is nobody left to tell.
  transformer.readable
    .pipeThrough(stamping)
    .pipeTo(transformer.writable)
    .catch(() => undefined);
};

function passes(frame: EncodedFrame, options: TransformOptions): boolean {
  const enteredMs = performance.timeOrigin + performance.now();
  const metadata = frame.getMetadata();
  const mark = options.trailer ? takeTrailer(frame) : markOf(metadata);
  const dropped =
    options.kind === "audio" && (isSkipped(options.receiver, metadata.rtpTimestamp) || isTooOld(mark));
  if (metadata.rtpTimestamp !== undefined) {
    const { receiver } = options;
    const times = options.kind === "video" ? timesOf(metadata.receiveTime, enteredMs) : null;
    scope.postMessage({ receiver, rtpTimestamp: metadata.rtpTimestamp, mark, dropped, times });
  }
  if (dropped || !options.packets) return !dropped;
  return !sounds.keep(options.receiver, metadata.rtpTimestamp, mark.stamp, frame.data);
}

/** `receiveTime` counts from this worker's own time origin. */
function timesOf(receiveTime: number | undefined, enteredMs: number): TransformTimes {
  return {
    receivedMs: receiveTime === undefined ? null : performance.timeOrigin + receiveTime,
    enteredMs,
    leftMs: performance.timeOrigin + performance.now(),
  };
}

/** `captureTime` counts from this worker's own time origin. */
function markOf(metadata: ReturnType<EncodedFrame["getMetadata"]>): FrameMark {
  const { captureTime } = metadata;
  return {
    stamp: eventOfOffset(metadata.senderCaptureTimeOffset),
    capturedMs: captureTime === undefined ? null : performance.timeOrigin + captureTime,
  };
}

function takeTrailer(frame: EncodedFrame): FrameMark {
  const { length, trailer } = splitTrailer(new Uint8Array(frame.data));
  if (trailer !== null) frame.data = frame.data.slice(0, length);
  return markOfTrailer(trailer);
}

function isSkipped(receiver: number, rtpTimestamp: number | undefined): boolean {
  const before = skips.get(receiver);
  if (before === undefined || rtpTimestamp === undefined) return false;
  if (rtpGap(before, rtpTimestamp) > 0) return true;
  skips.delete(receiver);
  return false;
}

/** The gap of a sound only grows: one that is too old now would never be heard. */
function isTooOld(mark: FrameMark): boolean {
  if (mark.stamp === null) return false;
  return judge(context.feedback, mark.stamp, context.tolerance, context.gate).verdict === "discard";
}
