import type { HeardSegment } from "../../drive/awaited_sound";
import { judge } from "../../gate/media_gate";
import { UNMARKED, ageOf, noteSeen, type FrameMark, type GateContext } from "../../gate/gate_counters";
import { START_MS, createSoundGate, observeSound } from "../../gate/sound_gate";
import { findMark } from "../../gate/stamp_table";
import type { MediaSection } from "../../transport/webrtc/media_section";
import type { StreamInfo } from "../../protocol/wire";
import type { StampReader } from "../../transport/encoded_transform/stamp_reader";
import { PacketSound } from "./packet_sound";
import { RenderLog } from "../render_log";
import { SoundOutput } from "./sound_output";
import type { SoundSource } from "./sound_source";
import { TrackSound } from "./track_sound";

/** One microphone: the segment being played is judged, and heard only while it passes. */
export class SoundStream {
  readonly gate = createSoundGate();
  readonly log = new RenderLog();
  isOpen = false;
  segment: HeardSegment | null = null; // that plays, heard or too old to be; null: none does
  private source: SoundSource;
  private output: SoundOutput;
  private droppedAtStart: number; // before decoding, to begin with the newest

  constructor(
    readonly info: StreamInfo,
    readonly section: MediaSection,
    private readonly reader: StampReader | null,
    private audio: AudioContext,
    private readonly context: () => GateContext,
    private readonly isAudible: () => boolean,
  ) {
    this.source = this.openSource();
    this.output = new SoundOutput(audio);
    this.output.connect(this.source.node);
    this.droppedAtStart = section.stamps?.dropped ?? 0;
    if (section.stamps !== null) section.stamps.onstamp = () => this.arrived();
  }

  /** Plays on another sound device from now on. */
  moveTo(audio: AudioContext): void {
    this.close();
    this.audio = audio;
    this.source = this.openSource();
    this.output = new SoundOutput(audio);
    this.output.connect(this.source.node);
  }

  /** Judges what plays now. Called at every feedback and every few milliseconds. */
  observe(context: GateContext, audible: boolean): void {
    this.source.tell(context);
    const playing = this.source.playing();
    const { stamps } = this.section;
    const mark = playing === undefined || stamps === null ? UNMARKED : findMark(stamps.table, playing);
    const before = this.gate.counts.rendered;
    const now = performance.now();
    const passes = playing !== undefined && this.judge(playing, mark, context, audible, now);
    if (this.gate.counts.rendered > before) this.note(mark ?? UNMARKED, context);
    this.isOpen = passes && audible;
    this.output.open(this.isOpen);
    const isReal = playing !== undefined && !this.isStarting() && !this.gate.isAhead;
    const stamp = isReal && audible ? (mark?.stamp ?? null) : null;
    const atMs = this.gate.playingSinceMs;
    this.segment = stamp === null ? null : { stamp, atMs, leftOut: this.dropped() };
  }

  private judge(
    playing: number,
    mark: FrameMark | undefined,
    context: GateContext,
    audible: boolean,
    now: number,
  ): boolean {
    const waiting = this.source.waiting(playing);
    const passes = observeSound(this.gate, playing, mark, context, audible, now, waiting);
    this.source.catchUp(playing, this.gate.isTooOld);
    const isEarly = now - (this.gate.playsSinceMs ?? now) < START_MS;
    if (this.isStarting() || (isEarly && this.source.leavesOut()))
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
    const mark = findMark(stamps.table, stamps.newest) ?? UNMARKED;
    const { feedback, tolerance, gate } = this.context();
    noteSeen(this.gate.counts, judge(feedback, mark.stamp, tolerance, gate).gap);
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
    this.source.close();
  }

  private openSource(): SoundSource {
    const { section, info, reader, audio } = this;
    const { track, stamps } = section;
    if (stamps?.packets === true && reader !== null) {
      const begun = (): void => this.observe(this.context(), this.isAudible());
      return new PacketSound(stamps, reader, info.codec, audio, begun, () => this.leaveToBrowser());
    }
    return new TrackSound(section, track, reader, info.codec === "PCMU" ? 8000 : 48_000, audio);
  }

  /** The page cannot play it: the browser does, as long as this connection lasts. */
  private leaveToBrowser(): void {
    const { stamps } = this.section;
    if (stamps === null) return;
    this.reader?.leave(stamps);
    this.source.close();
    this.source = this.openSource();
    this.output.connect(this.source.node);
  }
}
