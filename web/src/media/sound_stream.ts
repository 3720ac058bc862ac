import { judge } from "../core/media_gate";
import { UNMARKED, ageOf, noteSeen, type FrameMark, type GateContext } from "../core/medium_counts";
import { createSoundBacklog, skipTarget, waitingMs } from "../core/sound_backlog";
import { START_MS, createSoundGate, observeSound } from "../core/sound_gate";
import { findMark } from "../core/stamp_book";
import type { Section } from "../rtc/section";
import type { StreamInfo } from "../wire";
import type { StampReader } from "../rtc/stamp_reader";
import { RenderLog } from "./render_log";
import { SoundOutput } from "./sound_output";

/** One microphone: the segment being played is judged, and heard only while it passes. */
export class SoundStream {
  readonly gate = createSoundGate();
  readonly log = new RenderLog();
  isOpen = false;
  private readonly output: SoundOutput;
  private readonly backlog = createSoundBacklog();
  private droppedAtStart = 0; // before decoding, to begin with the newest
  private skipsStart = false; // what is left out, or was last, waited while the browser opened its sound device

  constructor(
    readonly info: StreamInfo,
    readonly section: Section,
    private readonly reader: StampReader | null,
    audio: AudioContext,
    private readonly context: () => GateContext,
  ) {
    this.output = new SoundOutput(audio, section.source);
    if (section.stamps !== null) section.stamps.onstamp = () => this.arrived();
  }

  /** Judges what plays now. Called at every feedback and every few milliseconds. */
  observe(context: GateContext, audible: boolean): void {
    const playing = this.section.playing();
    const { stamps } = this.section;
    const mark = playing === undefined || stamps === null ? UNMARKED : findMark(stamps.book, playing);
    const before = this.gate.counts.rendered;
    const passes = playing !== undefined && this.judge(playing, mark, context, audible, performance.now());
    if (this.gate.counts.rendered > before) this.note(mark ?? UNMARKED, context);
    this.isOpen = passes && audible;
    this.output.open(this.isOpen);
  }

  private judge(
    playing: number,
    mark: FrameMark | undefined,
    context: GateContext,
    audible: boolean,
    now: number,
  ): boolean {
    const queued = this.section.stamps?.queued ?? null;
    const waiting = queued === null ? 0 : waitingMs(queued, playing, this.clockRate());
    const passes = observeSound(this.gate, playing, mark, context, audible, now, waiting);
    if (queued !== null) this.catchUp(playing, queued, now);
    if (this.isStarting() || (this.skipsStart && this.backlog.skipTo !== null))
      this.droppedAtStart = this.section.stamps?.dropped ?? 0;
    return passes;
  }

  private note(mark: FrameMark, context: GateContext): void {
    const { gap } = this.gate.counts;
    const { feedback } = context;
    this.log.add({ stamp: mark.stamp, gap, feedback, at: performance.now(), age: ageOf(mark, context) });
  }

  /** A segment came; what is dropped before it is decoded is never observed. */
  private arrived(): void {
    const { stamps } = this.section;
    if (stamps === null || stamps.newest === null) return;
    const mark = findMark(stamps.book, stamps.newest) ?? UNMARKED;
    const { feedback, tolerance, gate } = this.context();
    noteSeen(this.gate.counts, judge(feedback, mark.stamp, tolerance, gate, null).gap);
  }

  private catchUp(playing: number, queued: number, now: number): void {
    const { stamps } = this.section;
    if (this.reader === null || stamps === null) return;
    const before = skipTarget(this.backlog, queued, playing, this.clockRate(), now, this.gate.isTooOld);
    if (before === null) return;
    this.skipsStart = now - (this.gate.playsSinceMs ?? now) < START_MS;
    this.reader.skip(stamps, before);
  }

  private clockRate(): number {
    return this.info.codec === "PCMU" ? 8000 : 48_000;
  }

  /** Whether the browser still plays what waited while it opened its sound device. */
  isStarting(): boolean {
    return this.gate.starting && this.gate.playing !== null;
  }

  /** Put to the gate, and dropped before. */
  received(): number {
    return this.gate.counts.received + this.dropped();
  }

  /** Discarded at the gate, and before decoding. */
  discarded(): number {
    return this.gate.counts.discarded + this.dropped();
  }

  private dropped(): number {
    return (this.section.stamps?.dropped ?? 0) - this.droppedAtStart;
  }

  level(): number {
    return this.isOpen ? this.output.level() : 0;
  }

  close(): void {
    this.output.close();
  }
}
