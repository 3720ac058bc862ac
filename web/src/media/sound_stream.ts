import type { GateContext } from "../core/medium_counts";
import { createSoundBacklog, skipTarget } from "../core/sound_backlog";
import { createSoundGate, observeSound } from "../core/sound_gate";
import { findStamp } from "../core/stamp_book";
import type { Section } from "../rtc/peer";
import type { StreamInfo } from "../wire";
import type { StampReader } from "../rtc/stamp_reader";
import { SoundOutput } from "./sound_output";

/** One microphone: the segment being played is judged, and heard only while it passes. */
export class SoundStream {
  readonly gate = createSoundGate();
  isOpen = false;
  private readonly output: SoundOutput;
  private readonly backlog = createSoundBacklog();

  constructor(
    readonly info: StreamInfo,
    readonly section: Section,
    private readonly reader: StampReader | null,
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
    if (source !== undefined) this.catchUp(source.rtpTimestamp);
    const passes =
      source !== undefined &&
      observeSound(this.gate, source.rtpTimestamp, stamp, context, audible, performance.now());
    this.isOpen = passes && audible;
    this.output.open(this.isOpen);
  }

  private catchUp(playing: number): void {
    const { stamps } = this.section;
    if (this.reader === null || stamps === null || stamps.newest === null) return;
    const clockRate = this.info.codec === "PCMU" ? 8000 : 48_000;
    const before = skipTarget(this.backlog, stamps.newest, playing, clockRate, performance.now());
    if (before !== null) this.reader.skip(stamps, before);
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
