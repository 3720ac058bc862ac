"""An encoded frame, shared by all peers that get it."""

from collections.abc import Callable

from lockstep.protocol.carriers import append_trailer
from lockstep.server.media.pipeline.picture_span_times import PictureSpanTimes

__all__ = ["EncodedFrame", "frame_trailer"]

Packetise = Callable[[bytes, bytes], list[bytes]]  # encoded data, trailer -> RTP payloads


def frame_trailer(stamp: int, capture_time: float) -> bytes:
    """Return the trailer for a frame captured at `capture_time` (s since 1970)."""
    return append_trailer(b"", stamp, _without_start_code(max(0, int(capture_time * 1_000_000))))


def _without_start_code(capture_time_us: int) -> int:
    """`capture_time_us`, or an earlier time that does not look like an H.264 start code in the trailer.

    There every byte is XORed with 0xFF, and 00 00 00 to 00 00 03 must not appear inside a NAL unit (H.264 7.4.1).
    The time is almost always right to the microsecond; for a quarter of a second in two weeks it is 0.3 s early.
    """
    data = bytearray(capture_time_us.to_bytes(8, "big"))
    for i in range(len(data) - 2):
        if data[i] == data[i + 1] == 0xFF and data[i + 2] >= 0xFC:
            data[i + 2] = 0xFB
            data[i + 3 :] = b"\x80" * (len(data) - i - 3)
    return int.from_bytes(data, "big")


class EncodedFrame:
    """One encoded picture or sound packet. Packetised at most once with and once without the trailer."""

    __slots__ = (
        "_packetise",
        "_plain",
        "_with_trailer",
        "capture_time",
        "data",
        "keyframe",
        "marker",
        "media_time",
        "stamp",
        "time",
        "timing",
    )

    def __init__(
        self,
        data: bytes,
        packetise: Packetise,
        *,
        keyframe: bool,
        marker: bool,
        stamp: int,
        capture_time: float,
        media_time: int,
        time: float = 0.0,
        timing: PictureSpanTimes | None = None,
    ) -> None:
        self.data = data
        self.keyframe = keyframe  # decodable without earlier frames; always so for sound
        self.marker = marker  # RTP marker of the last packet
        self.stamp = stamp  # event reference at capture
        self.capture_time = capture_time  # s since 1970
        self.media_time = media_time  # in the codec's RTP clock, from 0
        self.time = time  # s, at capture, on the monotonic clock of the source
        self.timing = timing  # of a picture; None: not measured
        self._packetise = packetise
        self._plain: list[bytes] | None = None
        self._with_trailer: list[bytes] | None = None

    def payloads(self, trailer: bool) -> list[bytes]:
        """Return the RTP payloads, with or without the trailer behind the frame."""
        if trailer:
            if self._with_trailer is None:
                self._with_trailer = self._packetise(self.data, frame_trailer(self.stamp, self.capture_time))
            return self._with_trailer
        if self._plain is None:
            self._plain = self._packetise(self.data, b"")
        return self._plain
