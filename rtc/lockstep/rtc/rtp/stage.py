"""The interface of all stages that packets pass, on the way out and on the way in.

A stage wraps the next one and knows no other: it takes a packet, does its one thing, and passes packets on. The last
one is a `Sink`, which collects. The owner of the chain calls its first stage and drains the sink.

    way out:  application → reports → history → keyframe requests → pacer → extensions → sink → encryption
    way in:   decryption → extensions → reports → repairs → losses → sink → application

Nothing here does I/O or reads a clock: `now` is handed in, in seconds of one monotonic clock.
"""

from dataclasses import dataclass, field
from typing import Literal

from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import ReportBlock, RtcpPacket

__all__ = [
    "Arrivals",
    "BandwidthEstimate",
    "KeyframeRequested",
    "PacketsGone",
    "PacketsLeft",
    "Reception",
    "RoundTrip",
    "Sink",
    "Stage",
    "StreamEnded",
    "StreamEvent",
    "earliest",
]


@dataclass(frozen=True, slots=True)
class KeyframeRequested:
    """The peer cannot go on without a keyframe."""

    ssrc: int


@dataclass(frozen=True, slots=True)
class Reception:
    """The peer's report about an outgoing stream, since its previous report."""

    ssrc: int
    expected: int  # packets
    lost: int  # packets
    block: ReportBlock
    round_trip: float | None  # s; None when this report tells none


@dataclass(frozen=True, slots=True)
class BandwidthEstimate:
    """The bitrate that the peer believes the path to carry, for these streams together (REMB)."""

    bitrate: int  # bit/s
    ssrcs: frozenset[int]


@dataclass(frozen=True, slots=True)
class Arrivals:
    """The arrival times of packets that were numbered for the whole transport, in the peer's clock."""

    arrivals: tuple[tuple[int, float | None], ...]  # transport-wide number and s; None: not yet


@dataclass(frozen=True, slots=True)
class PacketsGone:
    """Packets of a stream of the peer that will not come any more: what depends on them cannot be decoded."""

    ssrc: int
    reason: Literal["late", "too_many"]


@dataclass(frozen=True, slots=True)
class PacketsLeft:
    """The last packet that the pacer held back has left."""


@dataclass(frozen=True, slots=True)
class StreamEnded:
    """The peer said goodbye."""

    ssrc: int


StreamEvent = KeyframeRequested | Reception | BandwidthEstimate | Arrivals | PacketsGone | PacketsLeft | StreamEnded


@dataclass(slots=True)
class RoundTrip:
    """The round trip of one peer's path. Reports measure it; stages that wait for an answer read it."""

    seconds: float = 0.1  # an assumption until one is measured
    measured: bool = field(default=False)

    def measure(self, seconds: float) -> None:
        self.seconds, self.measured = seconds, True


class Stage:
    """Passes everything on. Stages override their methods, and call `super()` to pass on."""

    def __init__(self, following: "Stage") -> None:
        self.following = following

    def rtp(self, packet: RtpPacket, now: float) -> None:
        """Take a packet on its way."""
        self.following.rtp(packet, now)

    def rtcp(self, packet: RtcpPacket, now: float) -> None:
        """Take an RTCP packet that came from the peer."""
        self.following.rtcp(packet, now)

    def control(self, packet: RtcpPacket, now: float) -> None:
        """Take an RTCP packet that is to go to the peer."""
        self.following.control(packet, now)

    def event(self, event: StreamEvent) -> None:
        """Take an event for the application."""
        self.following.event(event)

    def timer(self) -> float | None:
        """Return the time at which `handle_timer` is due: the earliest of this stage and those behind it."""
        return earliest(self.due(), self.following.timer())

    def due(self) -> float | None:
        """Return the time at which this stage alone has something to do."""
        return None

    def handle_timer(self, now: float) -> None:
        """Do the due work."""
        self.following.handle_timer(now)


class Sink(Stage):
    """The end of a chain: keeps what arrived until it is drained."""

    def __init__(self) -> None:
        self.packets: list[RtpPacket] = []
        self.controls: list[RtcpPacket] = []
        self.events: list[StreamEvent] = []

    def rtp(self, packet: RtpPacket, now: float) -> None:
        self.packets.append(packet)

    def rtcp(self, packet: RtcpPacket, now: float) -> None:
        pass  # every stage has seen it

    def control(self, packet: RtcpPacket, now: float) -> None:
        self.controls.append(packet)

    def event(self, event: StreamEvent) -> None:
        self.events.append(event)

    def timer(self) -> float | None:
        return None

    def handle_timer(self, now: float) -> None:
        pass

    def drain_packets(self) -> list[RtpPacket]:
        packets, self.packets = self.packets, []
        return packets

    def drain_controls(self) -> list[RtcpPacket]:
        controls, self.controls = self.controls, []
        return controls

    def drain_events(self) -> list[StreamEvent]:
        events, self.events = self.events, []
        return events


def earliest(*times: float | None) -> float | None:
    """Return the earliest of these times; None if all are None."""
    return min((time for time in times if time is not None), default=None)
