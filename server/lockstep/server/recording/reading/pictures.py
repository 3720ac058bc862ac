"""Decodes the pictures of one camera as they were recorded: H.264 and VP8, also one after the other."""

import av
from av.video.codeccontext import VideoCodecContext

from lockstep.server.recording.format.payload import RecordedPicture

__all__ = ["RecordedPictures", "picture_size"]

MAX_PIXELS = 4096 * 2304  # of a picture


class RecordedPictures:
    """A decoder: `decode` each picture in turn, from a keyframe on; `flush` at the end.

    Raises:
        av.FFmpegError: by both methods, when a picture cannot be decoded.
    """

    def __init__(self) -> None:
        self._format = ""
        self._decoder: VideoCodecContext | None = None

    def decode(self, picture: RecordedPicture, number: int = 0) -> list[av.VideoFrame]:
        """Return the pictures that can be shown now. `number` comes back as the `pts` of this picture."""
        found: list[av.VideoFrame] = []
        if self._decoder is None or picture.format != self._format:
            found += self.flush()
            self._format = picture.format
            self._decoder = (
                av.CodecContext.create("vp8", "r") if picture.format == "vp8" else av.CodecContext.create("h264", "r")
            )
            self._decoder.options = {"max_pixels": str(MAX_PIXELS)}
        packet = av.Packet(picture.data)
        packet.pts = number
        return found + self._decoder.decode(packet)

    def flush(self) -> list[av.VideoFrame]:
        """Return the pictures that the decoder still holds back."""
        decoder, self._decoder = self._decoder, None
        return [] if decoder is None else decoder.decode(None)


def picture_size(keyframe: RecordedPicture) -> tuple[int, int] | None:
    """Return width and height; None if the picture cannot be decoded."""
    pictures = RecordedPictures()
    try:
        frames = [*pictures.decode(keyframe), *pictures.flush()]
    except av.FFmpegError:
        return None
    return (frames[0].width, frames[0].height) if frames else None
