"""Finds the media section of a packet in one bundle (RFC 9143 9.2)."""

from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from lockstep.rtc.rtp.wire.packet import RtpPacket

__all__ = ["Route", "Router"]

MAX_SOURCES = 64  # SSRCs that are remembered: as many as decryption lets through


@dataclass(frozen=True, slots=True)
class Route:
    """The packets of one section, as negotiated."""

    mid: str
    payload_types: frozenset[int]
    ssrcs: frozenset[int] = frozenset()  # announced; of retransmissions as well
    mid_extension: int | None = None  # id of the header extension with the mid; None: not in use


class Router:
    """Finds a packet's section. `counts`: "unknown" (no section wants it), "sources" (over MAX_SOURCES SSRCs)."""

    def __init__(self, routes: Iterable[Route]) -> None:
        self.counts: Counter[str] = Counter()
        self._routes = {route.mid: route for route in routes}
        self._by_ssrc = {ssrc: route.mid for route in self._routes.values() for ssrc in route.ssrcs}
        self._mid_extensions = {each.mid_extension for each in self._routes.values()} - {None}

    def route(self, packet: RtpPacket) -> str | None:
        """Return the mid; None if no section wants the packet."""
        mid = self._named(packet) or self._by_ssrc.get(packet.ssrc) or self._only_one_with(packet.payload_type)
        if mid is None or packet.payload_type not in self._routes[mid].payload_types:
            self.counts["unknown"] += 1
            return None
        if self._by_ssrc.get(packet.ssrc) != mid:
            if packet.ssrc not in self._by_ssrc and len(self._by_ssrc) >= MAX_SOURCES:
                self.counts["sources"] += 1
                return None
            self._by_ssrc[packet.ssrc] = mid  # RFC 9143 9.2: until the packet says something else
        return mid

    def ssrcs_of(self, mid: str) -> Collection[int]:
        return [ssrc for ssrc, owner in self._by_ssrc.items() if owner == mid]

    def _named(self, packet: RtpPacket) -> str | None:
        for number in self._mid_extensions:
            value = packet.extensions.get(number) if number is not None else None
            if value is not None:
                mid = value.decode("ascii", errors="replace")
                route = self._routes.get(mid)
                if route is not None and route.mid_extension == number:
                    return mid
        return None

    def _only_one_with(self, payload_type: int) -> str | None:
        having = [route.mid for route in self._routes.values() if payload_type in route.payload_types]
        return having[0] if len(having) == 1 else None
