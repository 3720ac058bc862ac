"""The event of a session by which the recording and live viewers get the records of episodes."""

from lockstep.server.recording.format.records import EpisodeRecord
from lockstep.server.session_events import SessionEvent

__all__ = ["EpisodeWritten"]


class EpisodeWritten(SessionEvent, frozen=True):
    """An episode begins, ends or gets a mark."""

    record: EpisodeRecord
