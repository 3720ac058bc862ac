"""What is still worth playing of a voice, and how much waits. No I/O, no clock is read here."""

__all__ = ["CUSHION", "MOST_WAITING", "Playout"]

CUSHION = 0.06  # s of silence ahead of what somebody begins to say: the network may be so unsteady
MOST_WAITING = 0.2  # s; what is later than that is not said any more


class Playout:
    """Ask `admit` for every packet. The newest wins: what would wait too long is left out."""

    def __init__(self) -> None:
        self._end = float("-inf")  # when what was written will have been played
        self.dropped = 0

    def admit(self, length: float, sent: float, now: float) -> float | None:
        """Seconds of silence to play before a packet of `length` s that came at `sent`; None: leave it out."""
        if now - sent > MOST_WAITING:
            self.dropped += 1
            return None
        silence = 0.0
        if self._end <= now:
            self._end, silence = now + CUSHION, CUSHION
        if self._end + length - now > MOST_WAITING:
            self.dropped += 1
            return None
        self._end += length
        return silence
