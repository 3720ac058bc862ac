"""Sends the frames of one stream to one peer, over its connection."""

from dataclasses import dataclass

from lockstep.protocol.carriers import (
    CAPTURE_TIME_URI,
    EVENT_REFERENCE_URI,
    PLAYOUT_DELAY_URI,
    Carrier,
    pack_capture_time,
    pack_event_reference,
    pack_playout_delay,
)
from lockstep.rtc.endpoint import Connection
from lockstep.rtc.rtp.outgoing import OutgoingStream
from lockstep.rtc.rtp.stage import Reception
from lockstep.server.media.pipeline.frame import EncodedFrame

__all__ = ["RtpSender", "SenderStats"]


@dataclass(slots=True)
class SenderStats:
    """Counters of one stream to one peer, and the peer's reports."""

    packets: int = 0  # sent, without retransmissions
    octets: int = 0  # of payload
    frames: int = 0  # sent
    retransmitted: int = 0  # packets
    not_retransmitted: int = 0  # packets asked for, but forgotten or over the budget
    not_repeated: int = 0  # packets asked for again while they were on their way
    keyframe_requests: int = 0  # PLI and FIR
    packets_lost: int = 0  # reported by the peer
    fraction_lost: float = 0.0  # reported by the peer, 0 to 1
    jitter_ms: float = 0.0  # reported by the peer
    round_trip_ms: float | None = None  # None before the first answer to a sender report
    remb_bps: int | None = None  # the peer's bandwidth estimate; None before the first


class RtpSender:
    """Adds stamps to frames, hands them to `Connection.send_frame`, and keeps the statistics."""

    def __init__(self, connection: Connection, mid: str, carrier: Carrier, *, video: bool, wall_clock: float) -> None:
        """`wall_clock`: s since 1970 at which the clock of the event loop was 0."""
        self._connection = connection
        self._mid = mid
        self._carrier = carrier
        self._fixed = {PLAYOUT_DELAY_URI: pack_playout_delay()} if video else {}
        self._wall_clock = wall_clock
        self._media_time = -1  # of the last frame
        self._frames = 0
        self._reported = SenderStats()

    @property
    def paced(self) -> bool:
        """True while part of the last frame waits for the pacer."""
        return self._connection.peer.media.streams.holds_back(self._mid)

    @property
    def rtp_time(self) -> int:
        """RTP timestamp of the last frame's packets; 0 without a stream."""
        stream = self._stream
        return 0 if stream is None else (stream.parameters.timestamp_offset + self._media_time) & 0xFFFFFFFF

    def transmit(self, frame: EncodedFrame) -> tuple[int, int] | None:
        """Send a frame and return its packets and payload bytes; None, nothing sent, while the network is blocked."""
        if self._connection.is_blocked:
            return None
        payloads = frame.payloads(self._carrier == "trailer")
        # A peer that changes its tier gets one picture from both: each frame needs a different time.
        self._media_time = max(self._media_time + 1, frame.media_time)
        self._connection.send_frame(
            self._mid,
            payloads,
            self._media_time,
            marker=frame.marker,
            values=self._values(frame),
            captured_at=frame.capture_time - self._wall_clock,
        )
        self._frames += 1
        return len(payloads), sum(map(len, payloads))

    def _values(self, frame: EncodedFrame) -> dict[str, bytes]:
        if self._carrier == "native":
            return {**self._fixed, EVENT_REFERENCE_URI: pack_event_reference(frame.stamp)}
        if self._carrier == "capture-time":
            return {**self._fixed, CAPTURE_TIME_URI: pack_capture_time(frame.stamp, frame.capture_time)}
        return self._fixed

    def reported(self, report: Reception) -> None:
        """Take a receiver report of the peer about this stream (RFC 3550 6.4.1)."""
        stats, block = self._reported, report.block
        stats.fraction_lost = block.fraction_lost / 256
        stats.packets_lost = block.packets_lost
        stream = self._stream
        if stream is not None:
            stats.jitter_ms = block.jitter * 1000 / stream.parameters.clock_rate
        if report.round_trip is not None:
            stats.round_trip_ms = report.round_trip * 1000

    def estimated(self, bitrate_bps: int) -> None:
        """Take the peer's estimate of the bitrate that its path carries (REMB)."""
        self._reported.remb_bps = bitrate_bps

    @property
    def round_trip_ms(self) -> float | None:
        """The round trip that the peer's reports tell; None before the first."""
        return self._reported.round_trip_ms

    @property
    def stats(self) -> SenderStats:
        """The current statistics."""
        stats, stream = self._reported, self._stream
        stats.frames = self._frames
        if stream is not None:
            stats.packets, stats.octets = stream.reports.packets, stream.reports.octets
            stats.keyframe_requests = stream.requests.keyframes
            if stream.history is not None:
                stats.retransmitted = stream.history.retransmitted
                stats.not_retransmitted = stream.history.refused
                stats.not_repeated = stream.history.on_their_way
        return stats

    @property
    def _stream(self) -> OutgoingStream | None:
        return self._connection.peer.media.streams.outgoing.get(self._mid)
