"""The stage that finds missing packets and asks for them (RFC 4585 6.2.1), on the way in."""

from dataclasses import dataclass

from lockstep.rtc.rtp.feedback import Nack
from lockstep.rtc.rtp.stage import PacketsGone, RoundTrip, Stage
from lockstep.rtc.rtp.wire.numbers import Unwrapper
from lockstep.rtc.rtp.wire.packet import RtpPacket

__all__ = ["Losses", "LossSettings"]

MAX_ASKED = 200  # packets in one NACK: it fits a datagram however they lie


@dataclass(frozen=True, slots=True)
class LossSettings:
    patience: float = 0.01  # s before a packet counts as lost: networks reorder a little
    again: float = 1.1  # round trips between two requests: a sender does not answer a second one within one round trip
    tries: int = 8  # requests for one packet, at most
    seconds: float = 1.5  # after so long no receiver waits for a packet any more
    missing: int = 512  # packets to wait for; with more a keyframe arrives sooner


@dataclass(slots=True)
class _Missing:
    since: float
    ask_at: float
    asked: int = 0


class Losses(Stage):
    def __init__(
        self, following: Stage, own_ssrc: int, ssrc: int, round_trip: RoundTrip, settings: LossSettings | None = None
    ) -> None:
        super().__init__(following)
        self.lost = 0  # packets that did not come in time
        self.repeated = 0  # packets that came twice or too late; they are dropped
        self._own_ssrc = own_ssrc
        self._ssrc = ssrc
        self._round_trip = round_trip
        self._settings = settings or LossSettings()
        self._numbers = Unwrapper()
        self._highest: int | None = None
        self._missing: dict[int, _Missing] = {}  # by unwrapped number, the lowest first

    def rtp(self, packet: RtpPacket, now: float) -> None:
        number = self._numbers.unwrap(packet.sequence_number)
        if self._highest is None:
            self._highest = number
        elif number > self._highest:
            self._note_gap(self._highest + 1, number, now)
            self._highest = number
        elif self._missing.pop(number, None) is None:
            self.repeated += 1
            return
        super().rtp(packet, now)

    def _note_gap(self, first: int, end: int, now: float) -> None:
        if end - first + len(self._missing) > self._settings.missing:
            self.lost += end - first + len(self._missing)
            self._missing.clear()
            self.event(PacketsGone(self._ssrc, "too_many"))
            return
        for number in range(first, end):
            self._missing[number] = _Missing(now, now + self._settings.patience)

    def due(self) -> float | None:
        return min((each.ask_at for each in self._missing.values()), default=None)

    def handle_timer(self, now: float) -> None:
        given_up = [number for number, each in self._missing.items() if self._is_hopeless(each, now)]
        for number in given_up:
            del self._missing[number]
        self.lost += len(given_up)
        wanted = [(number, each) for number, each in self._missing.items() if now >= each.ask_at]
        for _, each in wanted:
            each.asked += 1
            each.ask_at = now + max(self._settings.patience, self._settings.again * self._round_trip.seconds)
        numbers = [number & 0xFFFF for number, _ in wanted]
        for start in range(0, len(numbers), MAX_ASKED):
            self.control(Nack(self._own_ssrc, self._ssrc, tuple(numbers[start : start + MAX_ASKED])), now)
        if given_up:
            self.event(PacketsGone(self._ssrc, "late"))
        super().handle_timer(now)

    def _is_hopeless(self, missing: _Missing, now: float) -> bool:
        if now < missing.ask_at:
            return False
        return missing.asked >= self._settings.tries or now - missing.since > self._settings.seconds
