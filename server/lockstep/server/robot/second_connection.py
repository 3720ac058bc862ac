"""When a connection that waits for the end of another one is told to people. No I/O, no clock."""

from lockstep.protocol.dial_in import OWN_LINK_ENDS

__all__ = ["WAIT_ENDS", "SecondConnection"]

WAIT_ENDS = 30.0  # s without a try; a robot that waits dials again well before that


class SecondConnection:
    """The tries of a second robot while the first is connected. A robot that waits dials again and again."""

    def __init__(self) -> None:
        self._since, self._newest = 0.0, float("-inf")  # the first and the newest try of this wait
        self._is_told = False

    @property
    def lasts(self) -> bool:
        """Return whether the newest try is of a wait that is none of a robot's own last link."""
        return self._newest - self._since >= OWN_LINK_ENDS

    def is_news(self, now: float) -> bool:
        """Take a try. Return whether people are to be told: once a wait, and never of a robot's own last link."""
        if now - self._newest > WAIT_ENDS:
            self._since, self._is_told = now, False
        self._newest = now
        if self._is_told or not self.lasts:
            return False
        self._is_told = True
        return True
