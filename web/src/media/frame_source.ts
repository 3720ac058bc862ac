import { pictureOfElement, pictureOfFrame, type Picture } from "./picture";

/** Takes each decoded picture with its RTP timestamp, and owns the picture from then on. */
export type OnPicture = (picture: Picture, rtpTimestamp: number) => void;

/** Chromium's mediacapture-transform on the page; not in TypeScript's library. */
type TrackProcessor = new (init: { track: MediaStreamTrack; maxBufferSize?: number }) => {
  readonly readable: ReadableStream<VideoFrame>;
};

interface RtpFrame {
  metadata?(): { rtpTimestamp?: number };
}

/** Decoded pictures of a track, as early as the browser gives them. Returns what ends them. */
export function openFrames(track: MediaStreamTrack, onpicture: OnPicture): () => void {
  const processor = (globalThis as { MediaStreamTrackProcessor?: TrackProcessor }).MediaStreamTrackProcessor;
  if (processor !== undefined && "metadata" in VideoFrame.prototype)
    return readProcessor(new processor({ track, maxBufferSize: 1 }).readable, onpicture);
  return readElement(track, onpicture);
}

function readProcessor(readable: ReadableStream<VideoFrame>, onpicture: OnPicture): () => void {
  const reader = readable.getReader();
  const pump = async (): Promise<void> => {
    for (;;) {
      const { value, done } = await reader.read();
      if (done) return;
      const rtpTimestamp = (value as RtpFrame).metadata?.().rtpTimestamp;
      if (rtpTimestamp === undefined) value.close();
      else onpicture(pictureOfFrame(value), rtpTimestamp);
    }
  };
  // The stream errs when its track ends with the connection, which is reported elsewhere.
  pump().catch(() => undefined);
  return () => void reader.cancel().catch(() => undefined);
}

/** The element is never seen: it would show pictures that the gate has not judged. */
function readElement(track: MediaStreamTrack, onpicture: OnPicture): () => void {
  const video = document.createElement("video");
  video.className = "decoder";
  video.muted = true;
  video.autoplay = true;
  video.playsInline = true;
  video.srcObject = new MediaStream([track]);
  document.body.append(video);
  let handle = 0;
  const next = (_now: number, metadata: VideoFrameCallbackMetadata): void => {
    handle = video.requestVideoFrameCallback(next);
    if (metadata.rtpTimestamp !== undefined && video.videoWidth > 0)
      onpicture(pictureOfElement(video), metadata.rtpTimestamp);
  };
  handle = video.requestVideoFrameCallback(next);
  // Muted video may always play; it is interrupted only by being closed.
  video.play().catch(() => undefined);
  return () => {
    video.cancelVideoFrameCallback(handle);
    video.srcObject = null;
    video.remove();
  };
}
