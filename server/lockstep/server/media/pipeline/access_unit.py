"""Tells from its first bytes whether a payload may be a picture of H.264."""

__all__ = ["is_access_unit"]

MAX_BYTES = 4 << 20  # of one picture; far more than any that can be watched
NAL_TYPES = range(1, 24)  # of an access unit (ITU-T H.264, table 7-1)


def is_access_unit(payload: bytes) -> bool:
    """Return whether this may be a picture in Annex B form: it begins with a NAL unit of a known type."""
    start = payload.find(b"\x00\x00\x01", 0, 8)
    if not 0 <= start < len(payload) - 4 or len(payload) > MAX_BYTES:
        return False
    head = payload[start + 3]
    return head & 0x80 == 0 and head & 0x1F in NAL_TYPES
