import type { Closable } from "../gate/picture_gate";

/** A decoded picture that can be drawn any time until it is closed. */
export interface Picture extends Closable {
  readonly width: number;
  readonly height: number;
  readonly image: CanvasImageSource;
}

/** Wraps a VideoFrame; it belongs to the decoder's small pool, so it must be closed. */
export function pictureOfFrame(frame: VideoFrame): Picture {
  return { width: frame.displayWidth, height: frame.displayHeight, image: frame, close: () => frame.close() };
}

/** A copy of what a video element shows now: the element goes on to the next picture by itself. */
export function pictureOfElement(video: HTMLVideoElement): Picture {
  if (typeof VideoFrame === "function") return pictureOfFrame(new VideoFrame(video));
  const canvas = document.createElement("canvas");
  canvas.width = video.videoWidth;
  canvas.height = video.videoHeight;
  canvas.getContext("2d")?.drawImage(video, 0, 0);
  return { width: canvas.width, height: canvas.height, image: canvas, close: () => undefined };
}
