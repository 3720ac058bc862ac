/** Between the page, the transform worker and the audio worklet. */
import type { SoundContext } from "../../gate/gate_counters";
import type { SoundPacket } from "./sound_queue";

export const PROCESSOR = "lockstep-sound";

/** Options of one processor in the worklet. */
export interface ProcessorOptions {
  readonly rate: number; // Hz, of the packets' samples and RTP timestamps
  readonly blockS: number; // s that the sound device takes at once
}

/** Page to worklet. A port brings `SoundPacket`s from the transform worker, and takes `true` back for each. */
export type ProcessorOrder = SoundContext | { readonly packets: MessagePort } | { readonly close: true };

/** Worklet to page, whenever something changed. */
export interface PlayoutNote {
  readonly begun: readonly number[]; // RTP timestamps of packets that began to play, in order
  readonly playing: number | null; // RTP timestamp; null in a silence
  readonly waitingMs: number; // behind what plays
  readonly leftOut: number; // packets that came and did not play, since the note before
}

export function isSoundPacket(value: unknown): value is SoundPacket {
  return typeof value === "object" && value !== null && "samples" in value && "arrivedS" in value;
}
