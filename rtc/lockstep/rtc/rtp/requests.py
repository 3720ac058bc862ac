"""The stage that reads a peer's requests to an encoder: keyframes (RFC 4585 6.3.1, RFC 5104 4.3.1) and a bitrate."""

from dataclasses import dataclass

from lockstep.rtc.rtp.feedback import FullIntraRequest, PictureLoss, Remb, TransportFeedback
from lockstep.rtc.rtp.stage import Arrivals, BandwidthEstimate, KeyframeRequested, RoundTrip, Stage
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import RtcpPacket

__all__ = ["Requests", "RequestSettings"]


@dataclass(frozen=True, slots=True)
class RequestSettings:
    patience: float = 1.0  # s that a request waits, at most, for a retransmission that is on its way


class Requests(Stage):
    """Passes requests on. A peer that lacks packets asks for them and for a keyframe: the keyframe waits while they may
    still arrive.

    This stage stands behind the history, whose retransmissions pass through it.
    """

    def __init__(
        self, following: Stage, ssrc: int, round_trip: RoundTrip, settings: RequestSettings | None = None
    ) -> None:
        super().__init__(following)
        self.keyframes = 0  # requests
        self._ssrc = ssrc
        self._round_trip = round_trip
        self._settings = settings or RequestSettings()
        self._repaired_at = float("-inf")
        self._due: float | None = None  # the time to pass on a request that waits
        self._full_intra: int | None = None  # number of the last one

    def rtp(self, packet: RtpPacket, now: float) -> None:
        if packet.is_repair:
            self._repaired_at = now
        super().rtp(packet, now)

    def rtcp(self, packet: RtcpPacket, now: float) -> None:
        if isinstance(packet, PictureLoss) and packet.media_ssrc == self._ssrc:
            self._requested(now)
        elif isinstance(packet, FullIntraRequest):
            numbers = [number for ssrc, number in packet.requests if ssrc == self._ssrc]
            if numbers and numbers[-1] != self._full_intra:  # RFC 5104 4.3.1.2: the same number is a repetition
                self._full_intra = numbers[-1]
                self._requested(now)
        elif isinstance(packet, Remb) and self._ssrc in packet.ssrcs:
            self.event(BandwidthEstimate(packet.bitrate, frozenset(packet.ssrcs)))
        elif isinstance(packet, TransportFeedback) and packet.media_ssrc == self._ssrc:
            numbered = enumerate(packet.arrivals, packet.base)
            self.event(Arrivals(tuple((number & 0xFFFF, arrival) for number, arrival in numbered)))
        super().rtcp(packet, now)

    def _requested(self, now: float) -> None:
        self.keyframes += 1
        if self._due is not None:
            return
        wait = min(self._settings.patience, self._repaired_at + self._round_trip.seconds - now)
        if wait > 0:
            self._due = now + wait
        else:
            self.event(KeyframeRequested(self._ssrc))

    def due(self) -> float | None:
        return self._due

    def handle_timer(self, now: float) -> None:
        if self._due is not None and now >= self._due:
            self._due = None
            self.event(KeyframeRequested(self._ssrc))
        super().handle_timer(now)
