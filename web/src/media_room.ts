import type { GateContext } from "./core/medium_counts";
import type { ConsoleState } from "./core/console_state";
import { SoundStream } from "./media/sound_stream";
import { VideoStream } from "./media/video_stream";
import type { Peer } from "./rtc/peer";
import type { StampReader } from "./rtc/stamp_reader";
import type { StreamInfo } from "./wire";

export interface MediaRoomEvents {
  canvas(info: StreamInfo): HTMLCanvasElement;
  drawn(stream: VideoStream, stamp: number | null, at: number): void;
}

/** All streams of one connection, judged against the same newest feedback. */
export class MediaRoom {
  readonly videos = new Map<string, VideoStream>();
  readonly sounds = new Map<string, SoundStream>();

  constructor(
    private readonly state: ConsoleState,
    private readonly reader: StampReader | null,
    private readonly audio: AudioContext,
    private readonly events: MediaRoomEvents,
  ) {}

  /** Opens the streams that the console named. */
  open(peer: Peer, streams: readonly StreamInfo[]): void {
    for (const info of streams) {
      const section = peer.section(info.mid);
      if (section === undefined || this.videos.has(info.stream) || this.sounds.has(info.stream)) continue;
      if (info.kind === "audio") this.sounds.set(info.stream, new SoundStream(info, section, this.audio));
      else this.videos.set(info.stream, this.openVideo(info, section));
    }
    this.changed();
  }

  /** The feedback or a setting changed: everything is judged again. */
  changed(): void {
    this.reader?.tell(this.context("audio"));
    for (const video of this.videos.values()) video.settle();
    this.listen();
  }

  /** Judges the sound being played. */
  listen(): void {
    const context = this.context("audio");
    for (const sound of this.sounds.values()) sound.observe(context, this.isAudible());
  }

  /** Timers are slow on a hidden page, too slow to gate sound. */
  isAudible(): boolean {
    return this.audio.state === "running" && this.state.settings.soundWanted && !document.hidden;
  }

  context(kind: "audio" | "video"): GateContext {
    const { settings, feedback } = this.state;
    return {
      feedback: feedback?.event ?? null,
      tolerance: settings.tolerance[kind],
      enabled: settings.gateEnabled,
    };
  }

  close(): void {
    for (const stream of [...this.videos.values(), ...this.sounds.values()]) stream.close();
    this.videos.clear();
    this.sounds.clear();
  }

  private openVideo(info: StreamInfo, section: NonNullable<ReturnType<Peer["section"]>>): VideoStream {
    return new VideoStream(info, section, this.events.canvas(info), {
      context: () => this.context("video"),
      drawn: (stream, stamp, at) => this.events.drawn(stream, stamp, at),
    });
  }
}
