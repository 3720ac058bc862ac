"""Pictures of H.264 that a robot or a camera has encoded: which payload may be one, and how it is passed on."""

import time

from lockstep.server.media.codecs.packetise import packetise_h264
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.picture_span_times import PictureSpanTimes
from lockstep.server.media.pipeline.stage import SourceFrame

__all__ = ["is_access_unit", "passed_frame"]

MAX_BYTES = 4 << 20  # of one picture; far more than any that can be watched
NAL_TYPES = range(1, 24)  # of an access unit (ITU-T H.264, table 7-1)


def is_access_unit(payload: bytes) -> bool:
    """Return whether this may be a picture in Annex B form: it begins with a NAL unit of a known type."""
    start = payload.find(b"\x00\x00\x01", 0, 8)
    if not 0 <= start < len(payload) - 4 or len(payload) > MAX_BYTES:
        return False
    head = payload[start + 3]
    return head & 0x80 == 0 and head & 0x1F in NAL_TYPES


def passed_frame(frame: SourceFrame, media_time: int, encoding: TierEncoding) -> EncodedFrame | None:
    """Return the picture as `encoding` passes it on, unchanged; None if it cannot be packetised."""
    media, at = frame.media, frame.arrived_at
    encoded = EncodedFrame(
        media.payload,
        packetise_h264,
        keyframe=media.keyframe,
        marker=True,
        stamp=media.stamp,
        capture_time=encoding.monotone(frame.capture_time),
        media_time=media_time,
        time=media.time,
    )
    if not encoded.payloads(trailer=False):
        return None
    # Nothing is encoded here: from its arrival on it is being packetised.
    encoded.timing = PictureSpanTimes(media.spans, at, at, at, time.monotonic())
    return encoded
