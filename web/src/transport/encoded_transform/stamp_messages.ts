/** Between the page and the transform worker. */
import type { FrameMark } from "../../gate/gate_counters";

/** Options of one RTCRtpScriptTransform. */
export interface TransformOptions {
  readonly receiver: number; // our own number of the receiver
  readonly kind: "audio" | "video";
  readonly trailer: boolean; // the carrier is the trailer
  readonly packets: boolean; // sound that the page decodes and plays, and not the browser
}

/** Page to worker: leave out sound of this receiver that is older than `before`, to work off a backlog. */
export interface SoundSkip {
  readonly receiver: number;
  readonly before: number; // RTP timestamp
}

/** Page to worker: where the decoded sound of this receiver goes; null: nowhere, for now. */
export interface SoundRoute {
  readonly receiver: number;
  readonly codec: string; // "opus" or "PCMU"
  readonly port: MessagePort | null; // of the audio worklet
}

/** Page to worker: the browser is to decode and play the sound of this receiver. */
export interface SoundLeft {
  readonly receiver: number;
  readonly browserPlays: true;
}

export type SoundOrder = SoundSkip | SoundRoute | SoundLeft;

/** Worker to page: the sound of this receiver cannot be decoded here. */
export interface SoundFailure {
  readonly failedReceiver: number;
}

export function isSoundFailure(value: unknown): value is SoundFailure {
  return typeof value === "object" && value !== null && "failedReceiver" in value;
}

/** Worker to page, for every encoded frame. */
export interface FrameNote {
  readonly receiver: number;
  readonly rtpTimestamp: number;
  readonly mark: FrameMark;
  readonly dropped: boolean; // too old already or skipped; never decoded
  readonly times: TransformTimes | null; // of a picture
}

/** When a frame passed the worker; ms since 1970 by the worker's clock. */
export interface TransformTimes {
  readonly receivedMs: number | null; // its last packet; null where the browser does not say
  readonly enteredMs: number;
  readonly leftMs: number;
}

export function isFrameNote(value: unknown): value is FrameNote {
  return typeof value === "object" && value !== null && "receiver" in value && "rtpTimestamp" in value;
}
