"""Finds the streams that viewers want, from the topics that somebody is subscribed to. No I/O, no clock."""

from collections.abc import Set
from typing import NamedTuple

from lockstep.server.recording.format.topics import stream_of

__all__ = ["Subscribers", "Subscriptions"]


class Subscribers(NamedTuple):
    """The topics that viewers have subscribed to now."""

    any: bool  # somebody subscribed to something
    media: bool  # somebody subscribed to a camera or a microphone
    newcomer: bool  # a topic was not wanted at the last look
    media_newcomer: bool  # and is a camera's or a microphone's


class Subscriptions:
    """Call `look` at intervals."""

    def __init__(self) -> None:
        self._before: Set[str] = frozenset()

    def look(self, topics: Set[str]) -> Subscribers:
        """Return what is wanted. `topics`: those that somebody is subscribed to."""
        new, self._before = topics - self._before, topics
        return Subscribers(bool(topics), any(map(stream_of, topics)), bool(new), any(map(stream_of, new)))
