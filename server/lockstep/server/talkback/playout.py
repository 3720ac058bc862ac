"""Decides which packets of a voice are still worth playing. No I/O; reads no clock."""

__all__ = ["CUSHION", "MOST_WAITING", "Playout"]

CUSHION = 0.06  # s of silence before somebody begins to speak: the network may be that unsteady
MOST_WAITING = 0.2  # s; packets later than this are left out


class Playout:
    """Call `admit` for every packet. A packet that came too long ago, or would wait too long, is left out."""

    def __init__(self) -> None:
        self._end = float("-inf")  # time at which all written audio will have been played
        self.dropped = 0

    def admit(self, length: float, sent: float, now: float) -> float | None:
        """Return the s of silence to play before a packet of `length` s that came at `sent`; None to leave it out."""
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
