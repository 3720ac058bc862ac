"""Records of the robot's map and of its navigation: what has changed, and the map again once in a while."""

import math
import time

import msgspec

from lockstep.protocol.maps import Navigation, OccupancyMap
from lockstep.server.event_clock import EventClock
from lockstep.server.recording.format.records import MapRecord, NavigationRecord
from lockstep.server.recording.writing.record_sink import RecordSink
from lockstep.server.session_events import MapReceived, NavigationReceived, SessionEvents

__all__ = ["MapRecords"]

INTERVAL = 1.0  # s at least between two records of maps, 32 KiB each at most; the newest map waits
REPEAT = 60.0  # s after which a map is recorded again: a recording is cut into files


class MapRecords:
    """Keeps the newest of both, whether something is recorded or not."""

    def __init__(self, clock: EventClock, sink: RecordSink) -> None:
        self._clock = clock
        self._sink = sink
        self._map: OccupancyMap | None = None
        self._navigation: Navigation | None = None
        self._recorded: tuple[str, float] = ("", -math.inf)  # id of the recorded map, and when
        self._told: NavigationRecord | None = None

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(MapReceived, self._map_received)
        events.subscribe(NavigationReceived, self._navigation_received)

    def _map_received(self, event: MapReceived) -> None:
        self.take_map(event.map)
        self._put_due()

    def _navigation_received(self, event: NavigationReceived) -> None:
        self.take(event.navigation)
        self._put_due()

    def take_map(self, map: OccupancyMap) -> None:
        self._map = map

    def take(self, navigation: Navigation) -> None:
        self._navigation = navigation

    def begin(self) -> None:
        """A recording begins: it has nothing yet."""
        self._recorded, self._told = ("", -math.inf), None
        self._put_due()

    def forget(self) -> None:
        """Another bridge has another map."""
        self._map = self._navigation = None
        self._recorded, self._told = ("", -math.inf), None

    def _put_due(self) -> None:
        if self._sink.is_open:
            for record in self.due(self._clock.epoch, self._clock.event, time.monotonic()):
                self._sink.put_own(record)

    def due(self, epoch: str, event: int, now: float) -> list[MapRecord | NavigationRecord]:
        """Return what has to be recorded now, with the current event."""
        found: list[MapRecord | NavigationRecord] = []
        known, at = self._recorded
        if self._map is not None and now - at >= (REPEAT if self._map.id == known else INTERVAL):
            self._recorded = (self._map.id, now)
            found.append(MapRecord(epoch=epoch, event=event, map=self._map))
        if (said := self._navigation) is not None:
            record = NavigationRecord(
                epoch=epoch,
                event=said.event,
                map=said.map,
                located=said.located,
                frame=said.frame,
                goal=said.goal,
                path=said.path,
            )
            told = self._told
            if told is None or msgspec.structs.replace(record, event=told.event) != told:
                self._told = record
                found.append(record)
        return found
