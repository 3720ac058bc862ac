"""By when the bridge has to answer each press of STOP, and which presses count as undelivered. No I/O, no clock."""

from collections.abc import Callable, Iterable

from lockstep.server.stop.stop_presses import Press

__all__ = ["PressDeadlines"]


class PressDeadlines:
    """The deadlines of pending presses. A press that has missed its own is late, until the bridge answers it.

    `now` and the deadlines are monotonic seconds.
    """

    def __init__(self, late: Iterable[str]) -> None:
        """`late`: presses of an earlier run."""
        self._late = set(late)
        self._deadlines: dict[str, float] = {}

    def begin(self, press: str, until: float) -> None:
        self._deadlines[press] = until

    def is_late(self, press: str) -> bool:
        return press in self._late

    def overdue(self, pending: Iterable[Press], now: float) -> list[Press]:
        """Return those of the `pending` presses whose deadline is over. A late press has no deadline."""
        return [press for press in pending if now >= self._deadlines.get(press.id, now + 1)]

    def miss(self, press: str) -> bool:
        """Make a press late, without a deadline from now on. Return False if it was late before."""
        self._deadlines.pop(press, None)
        was_late = press in self._late
        self._late.add(press)
        return not was_late

    def end(self, press: str) -> bool:
        """Forget a press that the bridge has answered. Return True if it was late."""
        self._deadlines.pop(press, None)
        was_late = press in self._late
        self._late.discard(press)
        return was_late

    def keep(self, is_pending: Callable[[str], bool]) -> None:
        """Forget presses that are no longer pending."""
        self._late = {press for press in self._late if is_pending(press)}
        self._deadlines = {press: until for press, until in self._deadlines.items() if is_pending(press)}
