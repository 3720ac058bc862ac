import { closePictureGate, createPictureGate, offerPicture, settlePicture } from "../gate/picture_gate";
import type { FrameMark, GateContext } from "../gate/gate_counters";
import { gapOnScreen } from "../gate/staleness";
import { createRateMeter, noteOccurrence } from "../util/samples";
import type { MediaSection } from "../transport/webrtc/media_section";
import type { StreamInfo } from "../protocol/wire";
import { openFrames, type OnPicture } from "./frame_source";
import type { Picture } from "./picture";
import type { DrawnPicture, PictureTrace } from "./picture_trace";
import { RenderLog } from "./render_log";

export interface VideoStreamEvents {
  context(): GateContext; // read at the moment of drawing
  drawn(stream: VideoStream, stamp: number | null, at: number): void;
  over(context: CanvasRenderingContext2D, stream: string, stamp: number | null): void; // draws on the picture
}

/** One camera: its pictures pass the gate and are drawn on a canvas. */
export class VideoStream {
  readonly gate = createPictureGate<Picture>();
  readonly log = new RenderLog();
  trace: PictureTrace | null = null; // until its code is there, after the first picture
  readonly frames = createRateMeter();
  drawn: DrawnPicture | null = null; // the newest on the canvas
  width = 0;
  height = 0;
  lastDrawnMs: number | null = null;
  lastGoodMs: number | null = null; // when a picture last came, drawn or not
  private readonly drawing: CanvasRenderingContext2D | null;
  private readonly endFrames: () => void;

  constructor(
    readonly info: StreamInfo,
    readonly section: MediaSection,
    readonly canvas: HTMLCanvasElement,
    private readonly events: VideoStreamEvents,
  ) {
    // Desynchronized: a picture goes to the screen when it is drawn, and not with the page's next frame.
    this.drawing = canvas.getContext("2d", { alpha: false, desynchronized: true });
    if (section.stamps !== null) {
      section.stamps.onstamp = () => this.settle();
      section.stamps.onframe = (rtpTimestamp, times) => this.trace?.transformed(rtpTimestamp, times);
    }
    const take: OnPicture = (picture, rtpTimestamp) => {
      this.lastGoodMs = performance.now();
      this.trace?.decoded(rtpTimestamp, this.lastGoodMs);
      offerPicture(this.gate, picture, rtpTimestamp, this.lookup, events.context(), this.draw);
    };
    this.endFrames = openFrames(section.track, take);
  }

  /** Judges the waiting picture again. */
  settle(): void {
    settlePicture(this.gate, this.lookup, this.events.context(), this.draw);
  }

  /** By how many events the picture on screen is behind the newest feedback now; null while that is not known. */
  gapOnScreen(): number | null {
    return gapOnScreen(this.gate.shown, this.events.context());
  }

  close(): void {
    this.endFrames();
    closePictureGate(this.gate);
  }

  private readonly lookup = (rtpTimestamp: number): FrameMark | undefined => this.section.mark(rtpTimestamp);

  private readonly draw = (
    picture: Picture,
    stamp: number | null,
    gap: number | null,
    age: number | null,
  ): void => {
    const { canvas } = this;
    const began = performance.now();
    this.width = picture.width;
    this.height = picture.height;
    if (canvas.width !== picture.width) canvas.width = picture.width;
    if (canvas.height !== picture.height) canvas.height = picture.height;
    if (this.drawing !== null) {
      this.drawing.drawImage(picture.image, 0, 0);
      this.events.over(this.drawing, this.info.stream, stamp);
    }
    const at = performance.now();
    this.lastDrawnMs = at;
    noteOccurrence(this.frames, at);
    this.log.add({ stamp, gap, feedback: this.events.context().feedback, at, age });
    this.drawn = this.trace?.drawn(stamp, began, at) ?? null;
    this.events.drawn(this, stamp, at);
  };
}
