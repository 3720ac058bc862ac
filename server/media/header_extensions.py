"""RTP header extensions of one sender (RFC 8285): which carrier the offer asks for, and the bytes. No RTP stack."""

import struct
from collections.abc import Mapping

from robot_bridge.protocol.carriers import (
    CAPTURE_TIME_URI,
    EVENT_REFERENCE_URI,
    PLAYOUT_DELAY_URI,
    Carrier,
    pack_capture_time,
    pack_event_reference,
    pack_playout_delay,
)

__all__ = [
    "ABS_SEND_TIME_URI",
    "LARGEST_ID",
    "MID_URI",
    "ExtensionWriter",
    "choose_carrier",
    "pack_send_time",
    "wanted_uris",
]

MID_URI = "urn:ietf:params:rtp-hdrext:sdes:mid"
ABS_SEND_TIME_URI = "http://www.webrtc.org/experiments/rtp-hdrext/abs-send-time"

ONE_BYTE_PROFILE = 0xBEDE
TWO_BYTE_PROFILE = 0x1000
ONE_BYTE_MAX_ID = 14
LARGEST_ID = 255  # in the two-byte form; 0 is padding in both


def choose_carrier(offered: Mapping[str, int], trailer: bool) -> Carrier:
    """How the stamp travels to a peer that offers the extensions `offered` (URI to id)."""
    if trailer:
        return "trailer"
    if EVENT_REFERENCE_URI in offered:
        return "native"
    if CAPTURE_TIME_URI in offered:
        return "capture-time"
    return "none"


def wanted_uris(kind: str, carrier: Carrier) -> tuple[str, ...]:
    """Extensions that are answered if they are offered; all others are declined."""
    uris = [MID_URI]
    if carrier == "native":
        uris.append(EVENT_REFERENCE_URI)
    elif carrier == "capture-time":
        uris.append(CAPTURE_TIME_URI)
    if kind == "video":
        uris += [ABS_SEND_TIME_URI, PLAYOUT_DELAY_URI]
    return tuple(uris)


def pack_send_time(send_time: float) -> bytes:
    """abs-send-time of `send_time` (s): 24-bit 6.18 fixed point."""
    return (int(send_time * 0x40000) & 0xFFFFFF).to_bytes(3, "big")


class ExtensionWriter:
    """Packs the extension block of a packet; every packet of a frame carries the same one.

    All elements use the two-byte form if one id needs it (RFC 8285 4.1.2: forms are not mixed in a stream).
    """

    def __init__(self, ids: Mapping[str, int], mid: str) -> None:
        """`ids`: 1 to 255, by URI. Raises ValueError."""
        if not all(1 <= x <= LARGEST_ID for x in ids.values()):
            raise ValueError(f"header extension ids are 1 to {LARGEST_ID}, not {sorted(ids.values())}")
        self._two_byte = any(x > ONE_BYTE_MAX_ID for x in ids.values())
        self._native = ids.get(EVENT_REFERENCE_URI)
        self._capture_time = ids.get(CAPTURE_TIME_URI)
        self._abs_send_time = ids.get(ABS_SEND_TIME_URI)
        self.send_time_offset: int | None = None  # of abs-send-time in a block; None before the first, and without
        self._fixed = b""
        if MID_URI in ids and 1 <= len(mid.encode()) <= 16:
            self._fixed += self._element(ids[MID_URI], mid.encode())
        if PLAYOUT_DELAY_URI in ids:
            self._fixed += self._element(ids[PLAYOUT_DELAY_URI], pack_playout_delay())

    def _element(self, identifier: int, value: bytes) -> bytes:
        if self._two_byte:
            return bytes((identifier, len(value))) + value
        return bytes((identifier << 4 | len(value) - 1,)) + value

    def block(self, stamp: int, capture_time: float, send_time: float) -> bytes:
        """Header extension with its 4-byte header, or nothing when nothing was negotiated.

        `capture_time` and `send_time` are s since 1970.
        """
        elements = self._fixed
        if self._native is not None:
            elements += self._element(self._native, pack_event_reference(stamp))
        if self._capture_time is not None:
            elements += self._element(self._capture_time, pack_capture_time(stamp, capture_time))
        if self._abs_send_time is not None:
            elements += self._element(self._abs_send_time, pack_send_time(send_time))
            self.send_time_offset = 4 + len(elements) - 3
        if not elements:
            return b""
        words = (len(elements) + 3) // 4
        profile = TWO_BYTE_PROFILE if self._two_byte else ONE_BYTE_PROFILE
        return struct.pack("!HH", profile, words) + elements.ljust(words * 4, b"\x00")
