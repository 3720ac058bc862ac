"""Which chunks measure the round trip (Karn's rule, RFC 9260 6.3.1 C5; the I bit, RFC 7053)."""

from collections import Counter
from collections.abc import Sequence

from lockstep.rtc.sctp.sending.outgoing import Outgoing
from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.serial import unwrap
from lockstep.rtc.sctp.wire.chunks import IMMEDIATE

__all__ = ["RoundTripSamples"]

REMEMBERED = 256  # repeated TSNs, to know a needless repeat by


class RoundTripSamples:
    """Samples from acknowledgements. `ambiguous`: only repeated chunks were acknowledged, which says nothing about the
    round trip."""

    def __init__(self, round_trip: RoundTrip, interval: float, counts: Counter[str]) -> None:
        """`interval`: in s, between two newest-wins chunks that ask for a sample."""
        self.ambiguous = False
        self._round_trip = round_trip
        self._interval = interval
        self._counts = counts
        self._asked_at = float("-inf")  # the time at which a newest-wins chunk last had the I bit
        self._repeated: dict[int, None] = {}  # TSNs, the latest last

    def wants_one(self, now: float) -> bool:
        """True if the newest-wins chunk that leaves now is to ask for a sample."""
        if now - self._asked_at < self._interval or now - self._round_trip.sampled_at < self._interval:
            return False
        self._asked_at = now
        return True

    def take(self, arrived: list[Outgoing], now: float) -> None:
        """Take one sample, by the latest chunk that was sent once and that the peer acknowledges at once."""
        latest = float("-inf")
        ambiguous = False
        for chunk in arrived:
            if chunk.flags & IMMEDIATE:
                if chunk.sent_count > 1:
                    ambiguous = True
                elif chunk.sent_at > latest:
                    latest = chunk.sent_at
        if latest != float("-inf"):
            self._round_trip.sample(now - latest, now)
        elif ambiguous:
            self.ambiguous = True

    def repeated(self, chunk: Outgoing) -> None:
        """Note that a chunk leaves once more."""
        self._counts["repeats"] += 1
        self._repeated[chunk.tsn] = None
        if len(self._repeated) > REMEMBERED:
            del self._repeated[next(iter(self._repeated))]

    def take_duplicates(self, duplicates: Sequence[int], acknowledged: int, now: float) -> None:
        """Take the TSNs that the peer has received twice: their repeats were needless."""
        for duplicate in duplicates:
            tsn = unwrap(duplicate, acknowledged)
            if tsn in self._repeated:
                del self._repeated[tsn]
                self._counts["needless_repeats"] += 1
                self._round_trip.needless(now)
