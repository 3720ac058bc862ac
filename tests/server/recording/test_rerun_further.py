"""Maps, shadows, status, people, reports and traces, as Rerun's own library reads them from a file."""

import math
import zlib
from pathlib import Path

import pytest

from lockstep.protocol.actions import StatusItem
from lockstep.protocol.console import Participant, Report, StreamReport
from lockstep.protocol.maps import OccupancyMap
from lockstep.protocol.traces.trace import COMMAND_WAY, CommandSpans, PictureSpans
from lockstep.server.recording.format.records import (
    FeedbackRecord,
    MapRecord,
    NavigationRecord,
    OwnRecord,
    ParticipantsRecord,
    ReportRecord,
    ShadowRecord,
    StatusRecord,
    TraceRecord,
)
from tests.server.recording.makers import DESCRIPTION, EPOCH, START
from tests.server.recording.rrd import Entity, entities

from lockstep.server.recording.export.rerun.further_records import MOST_ENTITIES  # isort: skip  (needs rerun)
from lockstep.server.recording.export.rerun.further_records import MOST_PEER_ENTITIES  # isort: skip  (needs rerun)
from lockstep.server.recording.export.rerun.session_log import (  # isort: skip  (needs rerun, which `rrd` looks for)
    Moment,
    SessionLog,
    new_stream,
)


def logged(path: Path, *records: OwnRecord) -> dict[str, Entity]:
    stream = new_stream("a", EPOCH)
    stream.save(str(path))
    session = SessionLog(stream)
    session.begin(DESCRIPTION)
    for number, record in enumerate(records):
        session.own(record, Moment(record.event, START + number, START + number))
    session.flush()
    stream.flush()
    stream.disconnect()
    return entities(path)


def test_a_map_lies_where_the_robot_says_with_its_path_and_its_goal(tmp_path: Path) -> None:
    cells = bytes([0, 100, 255, 0, 0, 65])
    found = logged(
        tmp_path / "a.rrd",
        MapRecord(
            epoch=EPOCH,
            event=3,
            map=OccupancyMap(
                id="ab", width=3, height=2, resolution=0.5, origin=(1.0, 2.0, math.pi), cells=zlib.compress(cells)
            ),
        ),
        NavigationRecord(epoch=EPOCH, event=4, frame=(0.0, 1.0, 0.0), goal=[5.0, 6.0, 0.0], path=[1.0, 2.0, 5.0, 6.0]),
        NavigationRecord(epoch=EPOCH, event=5, located=False),
        MapRecord(
            epoch=EPOCH,
            event=6,
            map=OccupancyMap(id="ac", width=3, height=2, resolution=0.5, cells=zlib.compress(b"x")),
        ),
    )
    (grid,) = found["/map/grid"].rows
    assert grid["event"] == 3
    assert bytes(grid["GridMap:data"][0]) == bytes([0, 0, 65, 0, 100, 255])  # an image begins with its uppermost row
    assert grid["GridMap:cell_size"] == [0.5]
    assert grid["GridMap:translation"][0] == [1.0, 2.0, 0.0]
    (placed,) = found["/map"].rows
    assert placed["Transform3D:translation"][0] == pytest.approx([0.0, -1.0, 0.0])
    assert found["/map/path"].column("LineStrips3D:strips") == [[[[1.0, 2.0, 0.0], [5.0, 6.0, 0.0]]], []]
    assert found["/map/goal"].column("Points3D:positions") == [[[5.0, 6.0, 0.0]], []]


def test_what_shadows_wanted_what_the_robot_says_of_itself_and_who_is_there_is_told(tmp_path: Path) -> None:
    people = [Participant(peer="p", name="Ada", role="operator", carrier="trailer")]
    items = [
        StatusItem(name="battery", label="Battery", kind="battery", value=0.5),
        StatusItem(name="mode", label="Mode", value="docked", level="warning"),
    ]
    charged = [StatusItem(name="battery", label="Battery", kind="battery", value=0.75), items[1]]
    found = logged(
        tmp_path / "a.rrd",
        ParticipantsRecord(epoch=EPOCH, event=1, participants=people),
        StatusRecord(epoch=EPOCH, event=2, items=items),
        StatusRecord(epoch=EPOCH, event=5, items=charged),
        ShadowRecord(
            epoch=EPOCH, event=3, peer="q", name="net", values=[0.5, None], judgement="in_time", difference=0.25
        ),
        ShadowRecord(epoch=EPOCH, event=4, peer="q", name="net", values=[0.25, 0.0], judgement="late"),
        FeedbackRecord(
            epoch=EPOCH, event=6, issue=1, time=1.0, axes=[0.0, 0.0], faults=["hot", "lame"], limits=["wall"]
        ),
        FeedbackRecord(epoch=EPOCH, event=7, issue=1, time=1.1, axes=[0.0, 0.0], limits=["wall"]),
    )
    assert found["/people"].column("StateChange:state") == [["Ada (operator)"]]
    assert found["/status/battery"].column("Scalars:scalars") == [[0.5], [0.75]]
    assert found["/status/mode"].column("StateChange:state") == [["docked"]]  # where it changes
    assert found["/status/mode/level"].column("StateChange:state") == [["warning"]]
    wanted = found["/shadow/net/wanted"].column("Scalars:scalars")
    assert wanted[0] == [0.5, pytest.approx(math.nan, nan_ok=True)]
    assert wanted[1] == [0.25, 0.0]
    assert found["/shadow/net/wanted"].static[0]["SeriesLines:names"] == ["base.vx", "base.wz"]
    assert found["/shadow/net/difference"].column("event") == [3]
    assert found["/state/faults"].column("StateChange:state") == [["hot, lame"], [""]]
    assert found["/state/limits"].column("StateChange:state") == [["wall"]]


def test_reports_of_pages_and_traces_are_lines_with_names(tmp_path: Path) -> None:
    stream = StreamReport(stream="front", carrier="native", gap=1, max_gap=3, discarded=7, tolerance=4)
    report = Report(event=9, streams=[stream], picture_delay_ms=80.0)
    command = CommandSpans(forward_ms=0.5, back_ms=0.25)
    picture = PictureSpans(encode_ms=2.0)
    found = logged(
        tmp_path / "a.rrd",
        ReportRecord(epoch=EPOCH, event=9, peer="p", name="Ada", report=report),
        TraceRecord(epoch=EPOCH, event=9, command=command, stream="front", picture=picture),
        TraceRecord(epoch=EPOCH, event=10),
    )
    assert found["/reports/Ada/front"].column("Scalars:scalars") == [[1.0, 3.0, 7.0, 4.0]]
    assert found["/reports/Ada/delays"].column("Scalars:scalars")[0][0] == 80.0
    (way,) = found["/trace/command"].column("Scalars:scalars")
    names = found["/trace/command"].static[0]["SeriesLines:names"]
    assert names == [span.name.removesuffix("_ms") for span in COMMAND_WAY]
    known = {name: value for name, value in zip(names, way, strict=True) if not math.isnan(value)}
    assert known == {"forward": 0.5, "back": 0.25}
    assert len(found["/trace/picture/front"].rows) == 1


def test_names_that_peers_make_up_become_no_entities(tmp_path: Path) -> None:
    made_up = [StreamReport(stream=f"made up {number}", carrier="native") for number in range(31)]
    known = StreamReport(stream="ear", carrier="native", gap=2)
    found = logged(
        tmp_path / "a.rrd",
        ReportRecord(epoch=EPOCH, event=9, peer="p", name="Ada", report=Report(event=9, streams=[*made_up, known])),
        TraceRecord(epoch=EPOCH, event=9, stream="made up", picture=PictureSpans(encode_ms=2.0)),
    )
    assert {path for path in found if path.startswith(("/reports/", "/trace/"))} == {
        "/reports/Ada/delays",
        "/reports/Ada/ear",
    }


def shadow(name: str) -> ShadowRecord:
    return ShadowRecord(epoch=EPOCH, event=3, peer="q", name=name, values=[0.5, 0.0], judgement="late")


def test_however_many_names_come_and_go_an_epoch_has_a_bounded_number_of_entities(tmp_path: Path) -> None:
    names = [f"net {number}" for number in range(MOST_PEER_ENTITIES + 50)]
    found = logged(tmp_path / "a.rrd", *map(shadow, [*names, names[0]]))
    assert sum(path.startswith("/shadow/") for path in found) == MOST_PEER_ENTITIES
    assert len(found["/shadow/net\\ 0/wanted"].rows) == 2  # one that is known goes on


def test_names_of_peers_use_up_no_room_of_the_robot(tmp_path: Path) -> None:
    names = [f"net {number}" for number in range(MOST_PEER_ENTITIES + 50)]
    found = logged(
        tmp_path / "a.rrd",
        *map(shadow, names),
        StatusRecord(epoch=EPOCH, event=4, items=[StatusItem(name="mode", label="Mode", value="docked")]),
        FeedbackRecord(epoch=EPOCH, event=5, issue=1, time=1.0, axes=[0.0, 0.0], faults=["hot"]),
        TraceRecord(epoch=EPOCH, event=6, command=CommandSpans(forward_ms=0.5)),
    )
    assert found["/status/mode"].column("StateChange:state") == [["docked"]]
    assert found["/state/faults"].column("StateChange:state") == [["hot"]]
    assert "/trace/command" in found


def test_a_robot_has_a_bounded_number_of_entities_too(tmp_path: Path) -> None:
    items = [StatusItem(name=f"cell {number}", label="Cell", value=0.5) for number in range(MOST_ENTITIES + 50)]
    found = logged(tmp_path / "a.rrd", StatusRecord(epoch=EPOCH, event=4, items=items))
    assert sum(path.startswith("/status/") for path in found) == MOST_ENTITIES
