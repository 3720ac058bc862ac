import type { GateContext } from "../core/medium_counts";
import { createSoundGate, observeSound } from "../core/sound_gate";
import { findStamp } from "../core/stamp_book";
import type { Section } from "../rtc/peer";
import type { StreamInfo } from "../wire";
import { SoundOutput } from "./sound_output";

/** One microphone: the segment being played is judged, and heard only while it passes. */
export class SoundStream {
  readonly gate = createSoundGate();
  isOpen = false;
  private readonly output: SoundOutput;

  constructor(
    readonly info: StreamInfo,
    readonly section: Section,
    audio: AudioContext,
  ) {
    this.output = new SoundOutput(audio, section.transceiver.receiver.track);
  }

  /** Judges what plays now. Called at every feedback and every few milliseconds. */
  observe(context: GateContext, audible: boolean): void {
    const source = this.section.transceiver.receiver.getSynchronizationSources()[0];
    const { stamps } = this.section;
    const stamp =
      source === undefined || stamps === null ? null : findStamp(stamps.book, source.rtpTimestamp);
    const passes =
      source !== undefined &&
      observeSound(this.gate, source.rtpTimestamp, stamp, context, audible, performance.now());
    this.isOpen = passes && audible;
    this.output.open(this.isOpen);
  }

  /** Discarded at the gate, and before decoding. */
  discarded(): number {
    return this.gate.counts.discarded + (this.section.stamps?.dropped ?? 0);
  }

  level(): number {
    return this.isOpen ? this.output.level() : 0;
  }

  close(): void {
    this.output.close();
  }
}
