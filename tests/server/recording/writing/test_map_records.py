"""What of the robot's map and navigation is recorded, and when."""

import zlib

from lockstep.protocol.maps import Navigation, OccupancyMap
from lockstep.server.event_clock import EventClock
from lockstep.server.recording.format.records import MapRecord, NavigationRecord
from lockstep.server.recording.writing.map_records import INTERVAL, REPEAT, MapRecords
from lockstep.server.recording.writing.record_sink import RecordSink

MAP = OccupancyMap(id="a" * 32, width=2, height=1, resolution=0.5, cells=zlib.compress(bytes([0, 100])))
OTHER = OccupancyMap(id="b" * 32, width=2, height=1, resolution=0.5, cells=zlib.compress(bytes([0, 0])))


def made() -> MapRecords:
    return MapRecords(EventClock(), RecordSink())


def kinds(maps: MapRecords, now: float, event: int = 7) -> list[str]:
    """What is recorded now: ids of maps, and the events of navigations."""
    return [
        each.map.id[0] if isinstance(each, MapRecord) else str(each.event) for each in maps.due("epoch", event, now)
    ]


def test_a_map_is_recorded_when_it_changes_and_the_newest_waits_for_the_interval() -> None:
    maps = made()
    assert kinds(maps, 0.0) == []
    maps.take_map(MAP)
    assert kinds(maps, 0.0) == ["a"]
    maps.take_map(OTHER)
    maps.take_map(MAP)
    assert kinds(maps, INTERVAL / 2) == []
    maps.take_map(OTHER)
    assert kinds(maps, INTERVAL / 2) == []
    assert kinds(maps, INTERVAL) == ["b"]


def test_a_map_that_stays_is_repeated_for_the_files_that_a_recording_is_cut_into() -> None:
    maps = made()
    maps.take_map(MAP)
    assert [kinds(maps, now) for now in (0.0, REPEAT - 1, REPEAT, REPEAT + 1)] == [["a"], [], ["a"], []]


def test_a_navigation_is_recorded_when_more_than_its_event_and_its_ages_has_changed() -> None:
    maps = made()
    maps.take(Navigation(event=3, map_age=1.0, frame=(1.0, 0.0, 0.0)))
    assert kinds(maps, 0.0) == ["3"]
    maps.take(Navigation(event=4, map_age=2.0, path_age=1.0, frame=(1.0, 0.0, 0.0)))
    assert kinds(maps, 1.0) == []
    maps.take(Navigation(event=5, located=False, frame=(1.0, 0.0, 0.0)))
    (record,) = maps.due("epoch", 9, 2.0)
    assert isinstance(record, NavigationRecord)
    assert (record.epoch, record.event, record.located) == ("epoch", 5, False)


def test_each_recording_begins_with_what_holds_and_another_bridge_with_nothing() -> None:
    maps = made()
    maps.take_map(MAP)
    maps.take(Navigation(event=3))
    assert kinds(maps, 0.0) == ["a", "3"]
    maps.begin()
    assert kinds(maps, 0.1) == ["a", "3"]
    maps.forget()
    assert kinds(maps, 100.0) == []
