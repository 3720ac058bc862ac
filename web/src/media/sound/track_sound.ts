import { createSoundBacklog, skipTarget, waitingMs } from "../../gate/sound_backlog";
import type { MediaSection } from "../../transport/webrtc/media_section";
import type { StampReader } from "../../transport/encoded_transform/stamp_reader";
import type { SoundSource } from "./sound_source";

/** Sound that the browser decodes and buffers by its own rules. */
export class TrackSound implements SoundSource {
  readonly node: AudioNode;
  private readonly element = new Audio();
  private readonly backlog = createSoundBacklog();

  constructor(
    private readonly section: MediaSection,
    track: MediaStreamTrack,
    private readonly reader: StampReader | null,
    private readonly clockRate: number,
    context: AudioContext,
  ) {
    const stream = new MediaStream([track]);
    // Chromium decodes a remote track only while an element plays it; the element itself stays silent.
    this.element.muted = true;
    this.element.srcObject = stream;
    this.element.play().catch(() => undefined);
    this.node = context.createMediaStreamSource(stream);
  }

  playing(): number | undefined {
    return this.section.playing();
  }

  waiting(playing: number): number {
    const queued = this.section.stamps?.queued ?? null;
    return queued === null ? 0 : waitingMs(queued, playing, this.clockRate);
  }

  catchUp(playing: number, isTooOld: boolean): void {
    const { stamps } = this.section;
    if (this.reader === null || stamps === null || stamps.queued === null) return;
    const now = performance.now();
    const before = skipTarget(this.backlog, stamps.queued, playing, this.clockRate, now, isTooOld);
    if (before !== null) this.reader.skip(stamps, before);
  }

  tell(): void {
    // the browser knows of no gate
  }

  leavesOut(): boolean {
    return this.backlog.skipTo !== null;
  }

  close(): void {
    this.node.disconnect();
    this.element.srcObject = null;
  }
}
