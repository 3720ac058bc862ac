"""The events of a session that tell of episodes: their records, for the recording and live viewers, and their ends."""

from typing import Literal

from lockstep.server.recording.format.records import EpisodeRecord
from lockstep.server.session_events import SessionEvent

__all__ = ["EpisodeEnded", "EpisodeWritten"]


class EpisodeWritten(SessionEvent, frozen=True):
    """An episode begins, ends or gets a mark."""

    record: EpisodeRecord


class EpisodeEnded(SessionEvent, frozen=True):
    """An episode has ended, and nothing changes that any more: one that is kept is on the disk."""

    end: Literal["kept", "discarded", "cut"]
