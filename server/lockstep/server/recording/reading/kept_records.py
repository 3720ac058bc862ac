"""Leaves out of a recording what is of no kept episode, for exports of whole recordings."""

from collections.abc import Sequence

from lockstep.server.recording.episodes.edit_rules import EditedEpisode
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import EpisodeRecord, RobotRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.episode_of_event import EpisodeOfEvent
from lockstep.server.recording.reading.reader import Record

__all__ = ["KeptRecords"]

ROBOT, EPISODES = OWN_TOPICS[RobotRecord], OWN_TOPICS[EpisodeRecord]


class KeptRecords:
    """Ask `takes` of each record, in the order of the file.

    A record is of the episode that its event is of (`EpisodeOfEvent`). The robot's description is of all of them.
    """

    def __init__(self, episodes: Sequence[EditedEpisode]) -> None:
        """`episodes`: of the recording, with all changes."""
        self._entries = [each.entry for each in episodes]
        kept = [each for each in episodes if each.entry.state == "kept"]
        self._ids = {id for each in kept for id in each.recorded}
        self._places: dict[str, EpisodeOfEvent] = {}  # by topic: the events of one never go back

    def takes(self, record: Record) -> bool:
        """Return whether the record is of a kept episode."""
        if record.topic == ROBOT:
            return True
        if record.topic == EPISODES:
            own = own_record_of(record.schema, record.data)
            return isinstance(own, EpisodeRecord) and own.episode in self._ids
        places = self._places.setdefault(record.topic, EpisodeOfEvent(self._entries))
        episode = places.of(record.event)
        return episode is not None and episode.state == "kept"
