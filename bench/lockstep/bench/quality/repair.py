"""Simulates losses and their repair: the console's and the client's own cores on either end of a lossy path.

Time is simulated, so the results do not depend on the load of the machine, and a seed repeats them exactly. The
pictures are sizes only: two packets each, keyframes of six, at 30 Hz, like 640x480 at about 500 kbit/s.
"""

import heapq
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count

from lockstep.bench.quality.freezes import freezes
from lockstep.client.media.frame_assembler import MediaPacket, VideoAssembler
from lockstep.rtc.rtp.feedback import Nack, PictureLoss
from lockstep.rtc.rtp.history import RepairStream
from lockstep.rtc.rtp.losses import Losses
from lockstep.rtc.rtp.outgoing import OutgoingParameters, OutgoingStream, PathShare
from lockstep.rtc.rtp.repairs import Repairs
from lockstep.rtc.rtp.stage import KeyframeRequested, RoundTrip, Sink
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.server.media.encoding.keyframes import KeyframeScheduler

__all__ = ["Repaired", "simulate"]

FRAME_RATE = 30
PACKETS, KEYFRAME_PACKETS = 2, 6
MEDIA, AGAIN = 97, 98  # payload types
PARAMETERS = OutgoingParameters(
    ssrc=1,
    payload_type=MEDIA,
    clock_rate=90_000,
    cname="",
    first_sequence_number=0,
    timestamp_offset=0,
    repair=RepairStream(2, AGAIN, 0),
)


@dataclass
class Repaired:
    """The results of a simulation."""

    shown: list[float] = field(default_factory=list)  # s, at which each picture was complete
    pictures: int = 0  # sent
    keyframes: int = 0
    packets: int = 0  # sent, without the repeated ones
    repeated: int = 0
    keyframe_requests: int = 0

    def figures(self, seconds: float) -> dict[str, float | int]:
        frozen = freezes(self.shown)
        return {
            "pictures_sent": self.pictures,
            "pictures_shown_percent": round(len(self.shown) / self.pictures * 100, 2),
            "freezes_per_minute": round(len(frozen) * 60 / seconds, 2),
            "frozen_seconds_per_minute": round(sum(frozen) * 60 / seconds, 2),
            "longest_freeze_s": round(max(frozen, default=0.0), 2),
            "keyframes_per_minute": round(self.keyframes * 60 / seconds, 1),
            "keyframe_requests": self.keyframe_requests,
            "packets_repeated_percent": round(self.repeated / self.packets * 100, 2),
        }


def simulate(
    *, loss: float, round_trip: float, seconds: float, seed: int, burst: float = 1.0, retransmit: bool = True
) -> Repaired:
    """Simulate `seconds` of pictures; `burst`: packets lost together, on average."""
    simulation = _Simulation(loss, round_trip, random.Random(seed), burst, retransmit)
    return simulation.run(seconds)


class _Simulation:
    def __init__(self, loss: float, round_trip: float, draw: random.Random, burst: float, retransmit: bool) -> None:
        self._one_way = round_trip / 2
        self._draw = draw
        self._enter = loss / (1 - loss) / burst  # chance that a spell of loss begins with a packet
        self._leave = 1 / burst
        self._losing = {"down": False, "up": False}
        self._retransmit = retransmit
        self._agenda: list[tuple[float, int, Callable[[float], None]]] = []
        self._order = count()
        self._server = OutgoingStream(PARAMETERS, PathShare(0.0, RoundTrip(round_trip, measured=True)), paced=False)
        self._keyframes = KeyframeScheduler(10.0, 0.3)
        self._client = VideoAssembler(lambda data: data[:1] == b"K")
        self._client.round_trip = round_trip
        self._sink = Sink()
        self._losses = Losses(self._sink, 0, PARAMETERS.ssrc, RoundTrip(round_trip))
        self._repairs = Repairs(self._losses, PARAMETERS.ssrc, {AGAIN: MEDIA})
        self._found = Repaired()

    def run(self, seconds: float) -> Repaired:
        for number in range(int(seconds * FRAME_RATE)):
            self._at(number / FRAME_RATE, self._picture)
        while self._agenda:
            now, _, action = heapq.heappop(self._agenda)
            action(now)
        self._found.packets = self._server.reports.packets
        self._found.repeated = 0 if self._server.history is None else self._server.history.retransmitted
        return self._found

    def _at(self, when: float, action: Callable[[float], None]) -> None:
        heapq.heappush(self._agenda, (when, next(self._order), action))

    def _pass(self, direction: str, now: float, action: Callable[[float], None]) -> None:
        """Pass a packet over the path unless it is lost, by a two-state chain (Gilbert)."""
        losing = self._losing[direction]
        chance = self._leave if losing else self._enter
        if self._draw.random() < chance:
            self._losing[direction] = losing = not losing
        if not losing:
            self._at(now + self._one_way, action)

    # at the console

    def _picture(self, now: float) -> None:
        keyframe = self._keyframes.take(now)
        size = KEYFRAME_PACKETS if keyframe else PACKETS
        kind = b"K" if keyframe else b"D"
        self._found.pictures += 1
        self._found.keyframes += keyframe
        self._server.send([kind] * size, round(now * 90_000), now)
        self._serve(now)

    def _serve(self, now: float) -> None:
        """Send the packets and handle the events of the console's core."""
        for packet in self._server.packets_to_send():
            self._send(packet, now)
        self._server.controls_to_send()
        for event in self._server.events():
            if isinstance(event, KeyframeRequested):
                self._keyframes.request()

    def _send(self, packet: bytes, now: float) -> None:
        self._pass("down", now, lambda then: self._arrived(packet, then))

    def _nacked(self, nack: Nack, now: float) -> None:
        if self._retransmit:
            self._server.rtcp(nack, now)
            self._serve(now)

    def _asked_for_keyframe(self, now: float) -> None:
        self._found.keyframe_requests += 1
        self._server.rtcp(PictureLoss(0, PARAMETERS.ssrc), now)
        self._serve(now)
        due = self._server.requests.due()
        if due is not None:
            self._at(due, self._request_is_due)

    def _request_is_due(self, now: float) -> None:
        self._server.handle_timer(now)
        self._serve(now)

    # at the client

    def _arrived(self, data: bytes, now: float) -> None:
        self._repairs.rtp(RtpPacket.parse(data), now)
        for packet in self._sink.drain_packets():
            medium = MediaPacket(packet.sequence_number, packet.timestamp, packet.marker, packet.payload, 1)
            self._found.shown += [now] * len(self._client.add(medium, now))
            if self._client.wants_keyframe(now):
                self._pass("up", now, self._asked_for_keyframe)
        self._look_again()

    def _look_again(self) -> None:
        due = self._losses.due()
        if due is not None:
            self._at(due, self._look_for_losses)

    def _look_for_losses(self, now: float) -> None:
        due = self._losses.due()
        if due is None or due > now:
            return  # put off, and planned anew then
        self._losses.handle_timer(now)
        for control in self._sink.drain_controls():
            if isinstance(control, Nack):
                self._pass("up", now, self._nacking(control))
        self._look_again()

    def _nacking(self, nack: Nack) -> Callable[[float], None]:
        return lambda then: self._nacked(nack, then)
