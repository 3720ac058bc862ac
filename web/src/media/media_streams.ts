import type { HeardSound } from "../drive/command_gate";
import type { GateContext } from "../gate/gate_counters";
import type { ConsoleState } from "../session/console_state";
import { BoundedLog } from "../util/bounded_log";
import type { AudioDevice } from "./sound/audio_device";
import type { SoundStream } from "./sound/sound_stream";
import type { PictureTrace } from "./picture_trace";
import type { ToolOverlay } from "./tool_overlay";
import { VideoStream } from "./video_stream";
import type { Peer } from "../transport/peer";
import type { MediaSection } from "../transport/webrtc/media_section";
import type { StampReader } from "../transport/encoded_transform/stamp_reader";
import type { StreamInfo } from "../protocol/wire";

interface WaitingSound {
  readonly info: StreamInfo;
  readonly section: MediaSection;
}

/** When an event's first feedback came. */
export interface FeedbackArrival {
  readonly event: number;
  readonly at: number; // ms, performance.now()
}

export interface MediaStreamsEvents {
  canvas(info: StreamInfo): HTMLCanvasElement;
  visible(): boolean; // whether the person sees the page
  drawn(stream: VideoStream, stamp: number | null, at: number): void;
}

/** All streams of one connection, judged against the same newest feedback. */
export class MediaStreams {
  overlay: ToolOverlay | null = null; // until its code is there
  readonly videos = new Map<string, VideoStream>();
  readonly sounds = new Map<string, SoundStream>();
  sound: typeof SoundStream | null = null; // until its code is there, after the first picture
  private newTrace: (() => PictureTrace) | null = null; // the same
  relay: string | null = null; // that the streams come through; null: from the console
  readonly feedbacks = new BoundedLog<FeedbackArrival>();
  private newest: number | null = null; // event of the last feedback
  private waitingSounds: WaitingSound[] = [];

  constructor(
    private readonly state: ConsoleState,
    private readonly reader: StampReader | null,
    private readonly audio: AudioDevice,
    private readonly events: MediaStreamsEvents,
  ) {}

  /** Traces the pictures of all cameras from now on. */
  traceBy(newTrace: () => PictureTrace): void {
    this.newTrace = newTrace;
    for (const video of this.videos.values()) video.trace = newTrace();
  }

  /** Opens the streams that the console named. */
  open(peer: Peer, streams: readonly StreamInfo[]): void {
    for (const info of streams) {
      const section = peer.section(info.mid);
      if (section === undefined || this.videos.has(info.stream)) continue;
      if (info.kind === "video") this.videos.set(info.stream, this.openVideo(info, section));
      else this.waitingSounds.push({ info, section });
    }
    this.changed();
  }

  /** The same streams come from elsewhere now. What is on screen stays until they do. */
  reopen(peer: Peer, streams: readonly StreamInfo[]): void {
    this.close();
    this.relay = peer.relayName;
    this.open(peer, streams);
  }

  /** The feedback or a setting changed: everything is judged again. */
  changed(): void {
    const event = this.state.feedback?.event ?? null;
    if (event !== null && event !== this.newest) this.feedbacks.add({ event, at: performance.now() });
    this.newest = event;
    this.reader?.tell(this.context("audio"));
    for (const video of this.videos.values()) video.settle();
    this.listen();
  }

  /** Judges the sound being played. */
  listen(): void {
    this.openSounds();
    const renewed = this.audio.renewed(performance.now());
    if (renewed !== null) for (const sound of this.sounds.values()) sound.moveTo(renewed);
    const context = this.context("audio");
    for (const sound of this.sounds.values()) sound.observe(context, this.isAudible());
  }

  /** What commands wait for: the sound of each microphone that is heard, unless it is not judged. */
  heard(): HeardSound[] {
    const { tolerance, gate } = this.context("audio");
    if (gate === "off" || !this.isAudible()) return [];
    return [...this.sounds].map(([microphone, { segment }]) => ({ microphone, segment, tolerance }));
  }

  /** Timers are slow on a hidden page, too slow to gate sound. */
  isAudible(): boolean {
    return this.audio.isRunning() && this.state.settings.soundWanted && this.events.visible();
  }

  context(kind: "audio" | "video"): GateContext {
    const { settings, feedback } = this.state;
    return {
      feedback: feedback?.event ?? null,
      tolerance: settings.tolerance[kind],
      gate: settings.gate,
      wallMs: performance.timeOrigin + performance.now(),
    };
  }

  close(): void {
    for (const stream of [...this.videos.values(), ...this.sounds.values()]) stream.close();
    this.relay = null;
    this.videos.clear();
    this.sounds.clear();
    this.waitingSounds = [];
  }

  private openSounds(): void {
    const { sound: Sound } = this;
    if (Sound === null) return;
    for (const { info, section } of this.waitingSounds.splice(0)) {
      const context = (): GateContext => this.context("audio");
      const sound = new Sound(info, section, this.reader, this.audio.open(), context, () => this.isAudible());
      this.sounds.set(info.stream, sound);
    }
  }

  private openVideo(info: StreamInfo, section: MediaSection): VideoStream {
    const video = new VideoStream(info, section, this.events.canvas(info), {
      context: () => this.context("video"),
      drawn: (stream, stamp, at) => this.events.drawn(stream, stamp, at),
      over: (...picture) => this.overlay?.paint(...picture),
    });
    video.trace = this.newTrace?.() ?? null;
    return video;
  }
}
