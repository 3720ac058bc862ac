"""The channels whose owner waits until less waits on them."""

from lockstep.rtc.sctp import Association

__all__ = ["Backlog"]


class Backlog:
    """`full`: channels whose queue was full, until half of it has left. `watched`: channels whose owner is told when
    nothing waits on them."""

    def __init__(self, association: Association) -> None:
        self.full: set[int] = set()
        self.watched: set[int] = set()
        self._association = association
        self._half_full = association.settings.send_queue // 2

    def filled(self, channel: int) -> None:
        """Note that a channel's queue is full."""
        self.full.add(channel)

    def watch(self, channel: int) -> None:
        """Tell once when nothing waits on a channel."""
        self.watched.add(channel)

    def take_writable(self) -> list[int]:
        """Return the channels whose owner need not wait any more."""
        half_empty = [each for each in self.full if self._association.buffered(each) <= self._half_full]
        empty = [each for each in self.watched if not self._association.has_waiting(each)]
        self.full.difference_update(half_empty)
        self.watched.difference_update(empty)
        return half_empty + empty

    def forget(self, channel: int) -> None:
        self.full.discard(channel)
        self.watched.discard(channel)

    def clear(self) -> None:
        self.full.clear()
        self.watched.clear()
