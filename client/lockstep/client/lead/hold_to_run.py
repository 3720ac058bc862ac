"""Whether the operator holds the key or the pedal: the leader drives only while it is held. No I/O, no clock.

A terminal tells of no release. A held key repeats there, so that it counts as held from the second character on that
comes soon after another, and as released when none comes. A pedal tells of both.
"""

__all__ = ["HeldKey", "HeldPedal"]

REPEAT = 0.2  # s between two characters of a held key at most; a slow terminal repeats eleven times a second


class HeldKey:
    """A key on a terminal, known by its repeats."""

    def __init__(self) -> None:
        self._last = float("-inf")
        self._repeats = False

    def typed(self, now: float) -> None:
        """Take a character of the key."""
        self._repeats = now - self._last <= REPEAT
        self._last = now

    def other(self) -> None:
        """Take any other character: the key is not held, whatever it is."""
        self._repeats, self._last = False, float("-inf")

    def held(self, now: float) -> bool:
        return self._repeats and now - self._last <= REPEAT


class HeldPedal:
    """A pedal or a key of an input device, which reports both ends. It has to be seen released first."""

    def __init__(self) -> None:
        self._down: set[int] = set()
        self._known = False

    def event(self, code: int, value: int) -> None:
        """Take an event of a key: 1 pressed, 0 released, 2 repeated (input-event-codes.h, EV_KEY)."""
        if value == 0:
            self._down.discard(code)
            self._known = True
        elif value == 1:
            self._down.add(code)
            self._known = True

    def lost(self) -> None:
        """Take that the kernel has dropped events, a release perhaps: the next press counts, after a release."""
        self._down.clear()
        self._known = False

    def gone(self) -> None:
        """The device was unplugged."""
        self._down.clear()

    def held(self, now: float) -> bool:
        return bool(self._down) and self._known
