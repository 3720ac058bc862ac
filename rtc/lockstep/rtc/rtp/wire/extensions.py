"""The stages of header extensions: names on this side, ids on the wire."""

from collections.abc import Mapping

from lockstep.rtc.rtp.stage import Stage
from lockstep.rtc.rtp.wire.packet import RtpPacket

__all__ = [
    "ABS_SEND_TIME_URI",
    "TRANSPORT_NUMBER_URI",
    "ExtensionReader",
    "ExtensionWriter",
    "TransportNumbers",
    "pack_send_time",
]

ABS_SEND_TIME_URI = "http://www.webrtc.org/experiments/rtp-hdrext/abs-send-time"
TRANSPORT_NUMBER_URI = "http://www.ietf.org/id/draft-holmer-rmcat-transport-wide-cc-extensions-01"
ONE_BYTE_MAX_ID = 14  # RFC 8285 4.2


def pack_send_time(seconds: float) -> bytes:
    """Return abs-send-time for `seconds`: 24 bits of 6.18 fixed point."""
    return (int(seconds * 0x40000) & 0xFFFFFF).to_bytes(3, "big")


class TransportNumbers:
    """Numbers the packets of all streams of one peer in the order in which they leave."""

    def __init__(self) -> None:
        self._next = 0

    def take(self) -> bytes:
        number = self._next & 0xFFFF
        self._next += 1
        return number.to_bytes(2, "big")


class ExtensionWriter(Stage):
    """Writes the extensions of a stream: fixed ones, the packet's own `values`, and values that are known only when it
    leaves. It is the last outgoing stage: a packet that waited in the pacer says when it really left."""

    def __init__(
        self,
        following: Stage,
        ids: Mapping[str, int],
        fixed: Mapping[str, bytes] | None = None,
        numbers: TransportNumbers | None = None,
    ) -> None:
        """`ids`: the negotiated ids, by URI; `fixed`: values of every packet, by URI; left out without an id."""
        super().__init__(following)
        self._ids = dict(ids)
        self._fixed = {self._ids[uri]: value for uri, value in (fixed or {}).items() if uri in self._ids}
        self._send_time = self._ids.get(ABS_SEND_TIME_URI)
        self._number = self._ids.get(TRANSPORT_NUMBER_URI)
        self._numbers = numbers or TransportNumbers()
        # RFC 8285 4.1.2: one stream does not mix both forms, unless both sides agreed to it.
        self._two_byte = any(number > ONE_BYTE_MAX_ID for number in self._ids.values())

    def rtp(self, packet: RtpPacket, now: float) -> None:
        elements = dict(self._fixed)
        for uri, value in packet.values.items():
            if uri in self._ids:
                elements[self._ids[uri]] = value
        if self._send_time is not None:
            elements[self._send_time] = pack_send_time(now)
        if self._number is not None:
            elements[self._number] = self._numbers.take()
        packet.extensions, packet.two_byte = elements, self._two_byte
        super().rtp(packet, now)


class ExtensionReader(Stage):
    """Names the extensions that came: `values` has them by URI, the application's own among them."""

    def __init__(self, following: Stage, ids: Mapping[str, int]) -> None:
        super().__init__(following)
        self._uris = {number: uri for uri, number in ids.items()}

    def rtp(self, packet: RtpPacket, now: float) -> None:
        uris = self._uris
        packet.values = {uris[number]: value for number, value in packet.extensions.items() if number in uris}
        super().rtp(packet, now)
