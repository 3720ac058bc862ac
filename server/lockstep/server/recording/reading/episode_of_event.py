"""Says of each event of a recording which episode it was driven in, with all changes to the episodes."""

from collections.abc import Sequence

from lockstep.protocol.serial import is_newer
from lockstep.server.recording.format.episodes import EpisodeEntry

__all__ = ["EpisodeOfEvent"]


class EpisodeOfEvent:
    """Ask `of` with events that never go back.

    An episode begins with the event that holds, which was driven before: it has the events behind its first one, up to
    its last one.
    """

    def __init__(self, episodes: Sequence[EpisodeEntry]) -> None:
        """`episodes`: of one epoch, in the order of their events."""
        self._episodes = episodes
        self._at = 0

    def of(self, event: int) -> EpisodeEntry | None:
        """Return the episode that the event is of; None: of none."""
        while self._at < len(self._episodes) and is_newer(event, self._episodes[self._at].last_event):
            self._at += 1
        if self._at == len(self._episodes):
            return None
        found = self._episodes[self._at]
        return found if is_newer(event, found.first_event) else None
