"""Leaves out of a recording what is of no kept episode, for exports of whole recordings."""

from bisect import bisect_left
from collections.abc import Sequence

from lockstep.protocol.serial import event_gap
from lockstep.server.recording.episodes.edit_rules import EditedEpisode
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import Degraded, EpisodeRecord, MapRecord, RobotRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.reader import Record

__all__ = ["KeptRecords"]

EPISODES = OWN_TOPICS[EpisodeRecord]
# What the robot and the place are, and that something was left out, is of all episodes.
OF_ALL = {OWN_TOPICS[RobotRecord], OWN_TOPICS[MapRecord], OWN_TOPICS[Degraded]}


class KeptRecords:
    """Ask `takes` of each record of a file, in any order.

    A record is of a kept episode if its event is behind the episode's first one, up to its last one, and if it came
    before the episode's end: the last event goes on to hold, and whatever is done then is of no episode, or of another.
    """

    def __init__(self, episodes: Sequence[EditedEpisode]) -> None:
        """`episodes`: of the recording, with all changes, in the order of their events."""
        kept = [each for each in episodes if each.entry.state == "kept"]
        self._ids = {id for each in kept for id in each.recorded}
        self._kept = [each.entry for each in kept]
        self._origin = self._kept[0].first_event if kept else 0
        self._lasts = [event_gap(each.last_event, self._origin) for each in self._kept]

    def takes(self, record: Record) -> bool:
        """Return whether the record is of a kept episode, or of all."""
        if record.topic in OF_ALL:
            return True
        if record.topic == EPISODES:
            own = own_record_of(record.schema, record.data)
            if not isinstance(own, EpisodeRecord) or own.episode not in self._ids:
                return False
            if own.kind != "mark":
                return True
        place = bisect_left(self._lasts, event_gap(record.event, self._origin))
        if place == len(self._kept):
            return False
        episode = self._kept[place]
        return event_gap(record.event, episode.first_event) > 0 and record.arrived // 1000 <= episode.ended
