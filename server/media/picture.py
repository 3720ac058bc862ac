"""Pictures from the robot link, as what encoders take."""

from collections.abc import Sequence

import av
import numpy as np
from av.codec.context import Flags
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext

from robot_bridge.protocol.messages import Media
from server.media.errors import PayloadError, UnsupportedCodecError

__all__ = ["PictureDecoder"]

MIN_SIDE = 16  # pixels


class PictureDecoder:
    """Turns `yuv420p`, `mjpeg` and `h264` payloads into yuv420p frames. Used from one thread."""

    def __init__(self) -> None:
        self._mjpeg: VideoCodecContext | None = None
        self._h264: VideoCodecContext | None = None

    def decode(self, media: Media, group: Sequence[Media] = ()) -> av.VideoFrame:
        """The picture.

        Args:
            group: for h264, all that has to be decoded for it, itself the last; the rest was decoded before

        Raises:
            PayloadError: the payload is not a picture of the size that `media` names.
            UnsupportedCodecError: none of these.
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
            self._mjpeg.thread_count = 1
        try:
            frames = self._mjpeg.decode(av.Packet(media.payload))
        except (FFmpegError, ValueError) as error:
            raise PayloadError(f"not a JPEG picture: {error}") from error
        if not frames:
            raise PayloadError("not a whole JPEG picture")
        frame = frames[-1]
        _check_size(frame.width, frame.height)
        return frame.reformat(format="yuv420p", dst_color_range="MPEG")

    def _from_h264(self, group: Sequence[Media]) -> av.VideoFrame:
        if not group:
            raise PayloadError("there is no keyframe to begin with yet")
        if self._h264 is None:
            self._h264 = av.CodecContext.create("h264", "r")
            self._h264.thread_count = 1
            self._h264.flags |= Flags.low_delay  # one in, one out: there are no B-frames
        frame = None
        for media in group:
            try:
                frames = self._h264.decode(av.Packet(media.payload))
            except (FFmpegError, ValueError) as error:
                raise PayloadError(f"not an H.264 picture: {error}") from error
            frame = frames[-1] if frames else frame
        if frame is None:
            raise PayloadError("not a whole H.264 picture")
        _check_size(frame.width, frame.height)
        return frame.reformat(format="yuv420p", dst_color_range="MPEG")


def _from_yuv420p(media: Media) -> av.VideoFrame:
    width, height = media.width, media.height
    _check_size(width, height)
    if len(media.payload) != width * height * 3 // 2:
        raise PayloadError(f"{len(media.payload)} bytes are not a yuv420p picture of {width}x{height}")
    planes = np.frombuffer(media.payload, np.uint8).reshape(height * 3 // 2, width)
    return av.VideoFrame.from_numpy_buffer(planes, format="yuv420p")  # without a copy


def _check_size(width: int, height: int) -> None:
    if width < MIN_SIDE or height < MIN_SIDE or width % 2 or height % 2:
        raise PayloadError(f"{width}x{height}: sides must be even and at least {MIN_SIDE} pixels")
