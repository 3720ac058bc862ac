"""The process that decodes one publisher's pictures: a decoder that fails harms neither the console nor a peer.

The first line of its input is a `SourceSpec`, then come `Encoded` pictures; it writes `Captured` pictures, as every
other source's process does. The end of its input means that the publisher has gone.
"""

import os
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import cast

import av
import msgspec
from av.codec.context import Flags
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from lockstep.server.media.pipeline.frame_rate_limiter import FrameRateLimiter
from lockstep.server.media.published.encoded_wire import PICTURES, Encoded
from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.sources.source_wire import SAID, Captured, Said, Trouble, Working

__all__ = ["PublishedPictures", "main"]

MAX_PIXELS = 1920 * 1088
MAX_RATE = 30.0  # Hz, of pictures passed on
MIN_SIDE = 16  # pixels
NICENESS = 10  # a publisher's pictures must not slow the console and its encoders
REMEMBERED = 64  # capture times of pictures that a decoder holds back
DECODERS = {"H264": "h264", "VP8": "vp8"}


class PublishedPictures:
    """Decodes pictures. Call `take` for each, in order; after one that cannot be decoded it waits for a keyframe."""

    def __init__(self, spec: SourceSpec, say: Callable[[Said], None]) -> None:
        self._spec = spec
        self._say = say
        self._context: VideoCodecContext | None = None
        self._number = 0
        self._times: dict[int, float | None] = {}  # of capture, by number
        self._thin = FrameRateLimiter(min(spec.rate or MAX_RATE, MAX_RATE))
        self._size = (0, 0)

    def take(self, picture: Encoded) -> None:
        if self._context is None:
            if not picture.keyframe:
                return
            self._context = _decoder(picture.codec)
        self._number += 1
        self._times[self._number] = picture.time
        if len(self._times) > REMEMBERED:
            del self._times[next(iter(self._times))]
        try:
            for frame in self._context.decode(_packet(picture.data, self._number)):
                self._emit(frame)
        except (FFmpegError, ValueError) as error:
            self._context = None
            self._say(Trouble("not_media", f"not a {picture.codec} picture: {type(error).__name__}"))

    def _emit(self, frame: VideoFrame) -> None:
        at = self._times.pop(frame.pts, None) if frame.pts is not None else None
        if frame.is_corrupt:
            raise ValueError("a picture with errors in it")
        if frame.width * frame.height > MAX_PIXELS or min(frame.width, frame.height) < MIN_SIDE:
            raise ValueError("too large or too small")
        if (frame.width, frame.height) != self._size:
            self._size = frame.width, frame.height
            self._say(Working(f"{frame.width}x{frame.height}"))
        if at is None or not self._thin.admit(at):
            return
        width, height = self._spec.size or (frame.width & ~1, frame.height & ~1)
        whole = frame.reformat(width, height, format="yuv420p", dst_color_range="MPEG", interpolation="AREA")
        payload = whole.to_ndarray(format="yuv420p").tobytes()
        self._say(Captured("yuv420p", at, payload, width, height))


def _packet(data: bytes, number: int) -> "av.Packet[VideoStream]":
    packet = cast("av.Packet[VideoStream]", av.Packet(data))
    packet.pts = number
    return packet


def _decoder(codec: str) -> VideoCodecContext:
    context = av.CodecContext.create(DECODERS[codec], "r")
    if not isinstance(context, VideoCodecContext):
        raise TypeError(f"{codec} is no codec of pictures")
    # Without concealment: a picture with invented parts would be shown as one that was captured.
    context.options = {"max_pixels": str(MAX_PIXELS), "err_detect": "explode"}
    context.thread_count = 1
    if codec == "H264":
        context.flags |= Flags.low_delay  # one in, one out
    return context


def decode_all(pictures: Iterable[Encoded], spec: SourceSpec, say: Callable[[Said], None]) -> None:
    decoding = PublishedPictures(spec, say)
    for picture in pictures:
        decoding.take(picture)


def main() -> None:
    os.nice(NICENESS)
    source = sys.stdin.buffer
    spec = msgspec.json.Decoder(SourceSpec).decode(source.readline())
    out = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # output that a library prints is not a message
    with suppress(OSError, KeyboardInterrupt):
        decode_all(iter(lambda: PICTURES.read(source), None), spec, lambda said: SAID.write(out, said))
    os._exit(0)


if __name__ == "__main__":
    main()
