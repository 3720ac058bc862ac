"""Turns pictures from the robot link into frames for encoders."""

from collections.abc import Sequence
from contextlib import suppress

import av
import numpy as np
import numpy.typing as npt
from av.codec.context import Flags
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.plane import VideoPlane

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.h264 import holds_slice
from lockstep.server.media.errors import PayloadError, UnsupportedCodecError

__all__ = ["PictureDecoder"]

MIN_SIDE = 16  # pixels
MAX_JPEG, MAX_H264 = 8192 * 4096, 4096 * 2304  # pixels; an H.264 decoder keeps up to seventeen pictures

Plane = npt.NDArray[np.uint8]


class PictureDecoder:
    """Turns `yuv420p`, `mjpeg` and `h264` payloads into yuv420p frames. Used from one thread.

    A side with an odd number of pixels loses its last one.
    """

    def __init__(self) -> None:
        self._mjpeg: VideoCodecContext | None = None
        self._h264: VideoCodecContext | None = None
        self._is_whole = False  # the H.264 pictures up to now were all decoded, from a keyframe on

    def decode(self, media: Media, group: Sequence[Media] = ()) -> av.VideoFrame:
        """Decode a picture.

        Args:
            group: for h264, the pictures still to be decoded for it, itself the last

        Raises:
            PayloadError: the payload is not a picture of the size that `media` names.
            UnsupportedCodecError: `media` has another codec.
        """
        if media.codec == "h264":
            return self._from_h264(group)
        if media.codec == "yuv420p":
            return _from_yuv420p(media)
        if media.codec == "mjpeg":
            return self._from_mjpeg(media)
        raise UnsupportedCodecError(f"{media.codec} cannot be encoded again")

    def _from_mjpeg(self, media: Media) -> av.VideoFrame:
        if self._mjpeg is None:
            self._mjpeg = av.CodecContext.create("mjpeg", "r")
            self._mjpeg.options = {"max_pixels": str(MAX_JPEG)}  # a few bytes can claim to be any number
            self._mjpeg.thread_count = 1
        try:
            frames = self._mjpeg.decode(av.Packet(media.payload))
        except (FFmpegError, ValueError) as error:
            raise PayloadError(f"not a JPEG picture: {error}") from error
        if not frames:
            raise PayloadError("not a whole JPEG picture")
        frame = frames[-1]
        _check_size(frame.width, frame.height)
        return _even(frame.reformat(format="yuv420p", dst_color_range="MPEG"))

    def _from_h264(self, group: Sequence[Media]) -> av.VideoFrame:
        if not group:
            raise PayloadError("no keyframe has arrived yet")
        if self._h264 is None:
            self._h264 = av.CodecContext.create("h264", "r")
            self._h264.options = {"max_pixels": str(MAX_H264)}
            self._h264.thread_count = 1
            self._h264.flags |= Flags.low_delay  # one in, one out: there are no B-frames
        frame = None
        for media in group:
            if not holds_slice(media.payload):
                with suppress(FFmpegError, ValueError):  # it finds no picture, and keeps the parameter sets
                    self._h264.decode(av.Packet(media.payload))
                continue
            if not media.keyframe and not self._is_whole:
                continue  # FFmpeg would draw it over grey, or over a picture that it does not build on
            self._is_whole = False
            try:
                frames = self._h264.decode(av.Packet(media.payload))
            except (FFmpegError, ValueError) as error:
                raise PayloadError(f"not an H.264 picture: {error}") from error
            self._is_whole = True
            frame = frames[-1] if frames else frame
        if frame is None:
            raise PayloadError("not a whole H.264 picture")
        _check_size(frame.width, frame.height)
        return frame.reformat(format="yuv420p", dst_color_range="MPEG")


def _from_yuv420p(media: Media) -> av.VideoFrame:
    width, height = media.width, media.height
    _check_size(width, height)
    chroma = (width + 1) // 2 * ((height + 1) // 2)
    if len(media.payload) != width * height + 2 * chroma:
        raise PayloadError(f"{len(media.payload)} bytes are not a yuv420p picture of {width}x{height}")
    if width % 2 == 0 and height % 4 == 0:  # PyAV takes whole groups of six rows of such an array, and no other
        rows = np.frombuffer(media.payload, np.uint8).reshape(height * 3 // 2, width)
        return av.VideoFrame.from_numpy_buffer(rows, format="yuv420p")  # without a copy
    luma, u, v = np.split(np.frombuffer(media.payload, np.uint8), (width * height, width * height + chroma))
    half = ((height + 1) // 2, (width + 1) // 2)
    return _frame(luma.reshape(height, width), u.reshape(half), v.reshape(half))


def _even(frame: av.VideoFrame) -> av.VideoFrame:
    """Drop the last row or column of an odd number: H.264 and VP8 encoders take even sides only."""
    if frame.width % 2 == 0 and frame.height % 2 == 0:
        return frame
    luma, u, v = (_rows(plane)[: plane.height, : plane.width] for plane in frame.planes)
    return _frame(luma, u, v)


def _frame(luma: Plane, u: Plane, v: Plane) -> av.VideoFrame:
    """Make a frame of these planes, without the row or column that makes a side odd."""
    height, width = luma.shape
    frame = av.VideoFrame(width - width % 2, height - height % 2, "yuv420p")
    for plane, values in zip(frame.planes, (luma, u, v), strict=True):
        _rows(plane)[: plane.height, : plane.width] = values[: plane.height, : plane.width]
    return frame


def _rows(plane: VideoPlane) -> Plane:
    """Return the plane's memory, row by row, padding included; writing to it changes the plane."""
    return np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)


def _check_size(width: int, height: int) -> None:
    if width < MIN_SIDE or height < MIN_SIDE:
        raise PayloadError(f"{width}x{height}: sides must have at least {MIN_SIDE} pixels")
