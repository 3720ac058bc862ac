"""Items that become a file of Rerun's, by the code of the process that speaks to Rerun."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from lockstep.protocol.messages import Feedback
from lockstep.server.recording.format.drivers import NOBODY, EventDriver
from lockstep.server.recording.format.records import NoteRecord, RobotRecord
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, OwnItem, RobotItem
from tests.server.recording.makers import CODECS, DESCRIPTION, EPOCH, START
from tests.server.recording.rrd import entities, recording_ids

from lockstep.server.rerun import rerun_process  # isort: skip  (needs rerun, which `rrd` looks for)
from lockstep.server.rerun.rerun_process import Sink, take_items  # isort: skip

OTHER = "epoch-2"


def robot(epoch: str = EPOCH) -> RobotItem:
    return RobotItem(START, RobotRecord(epoch=epoch, event=1, link="up", description=DESCRIPTION), CODECS)


def note(text: str, epoch: str = EPOCH) -> OwnItem:
    return OwnItem(START, NoteRecord(epoch=epoch, event=7, peer="p", name="Ada", role="operator", text=text))


def feedback(event: int, epoch: str = EPOCH, driver: EventDriver = NOBODY) -> FeedbackItem:
    found = Feedback(event=event, issue=1, time=1.0, axes=[0.5, 0.25], joints=[1.0, 2.0, 0.5])
    return FeedbackItem(START, START, epoch, found, driver)


def picture(event: int, codec: str = "H264") -> MediaItem:
    return MediaItem(START, START, EPOCH, "front", codec, event, True, b"\0\0\1\x65picture")


def test_what_held_before_the_robot_was_told_is_logged_and_sound_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    items: list[Item | None] = [
        note("before"),
        robot(),
        feedback(7),
        picture(5),
        picture(7, "opus"),
        None,
        note("after"),
    ]
    take_items(iter(items), Sink("file", str(path), 1_000_000))
    found = entities(path)
    assert recording_ids(path) == [EPOCH]
    said = sorted(text for (text,) in found["/log"].column("TextLog:text"))
    assert said == ["Ada: after", "Ada: before", "robot link up"]
    assert found["/axes/measured"].column("event") == [7]
    assert found["/camera/front"].column("event") == [5]
    assert found["/gap/front"].column("Scalars:scalars") == [[2.0]]


def test_who_drove_each_event_and_what_was_an_intervention_is_in_the_live_session(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    policy, person = EventDriver("net", "policy"), EventDriver("Ada", "human", intervention=True)
    items: list[Item | None] = [
        robot(),
        *(feedback(at, driver=each) for at, each in enumerate([NOBODY, policy, policy, person, NOBODY])),
    ]
    take_items(iter(items), Sink("file", str(path), 1_000_000))
    found = entities(path)
    changes = [(row["event"], row["StateChange:state"]) for row in found["/driver"].rows]
    assert changes == [(1, ["net"]), (3, ["Ada"]), (4, [""])]
    assert found["/driver/kind"].column("StateChange:state") == [["policy"], ["human"], [""]]
    assert found["/driver/intervention"].column("Scalars:scalars") == [[0.0], [0.0], [0.0], [1.0], [0.0]]


def test_another_epoch_is_another_file_and_nothing_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "sub" / "a.rrd"
    path.parent.mkdir()
    path.write_bytes(b"somebody's")
    items: list[Item | None] = [robot(), feedback(3), feedback(9, OTHER), robot(OTHER), feedback(4, OTHER), feedback(5)]
    take_items(iter(items), Sink("file", str(path), 1_000_000))
    assert path.read_bytes() == b"somebody's"
    first, second = path.with_stem("a-2"), path.with_stem("a-3")
    assert (recording_ids(first), recording_ids(second)) == ([EPOCH], [OTHER])
    assert entities(first)["/joints"].column("event") == [3]
    assert entities(second)["/joints"].column("event") == [4]


def test_a_file_ends_at_its_bound_and_what_was_written_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rerun_process, "FILE_SECONDS", 0.0)
    path = tmp_path / "a.rrd"

    def without_end() -> Iterator[Item]:
        yield robot()
        number = 0
        while True:
            number += 1
            yield MediaItem(START, START, EPOCH, "front", "H264", number, True, bytes(100_000) + b"%d" % number)

    with pytest.raises(OSError, match="bound"):
        take_items(without_end(), Sink("file", str(path), 300_000))  # more than the robot
    assert entities(path)["/camera/front"].rows


def test_a_viewer_that_is_not_there_is_told_at_once() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(OSError, match="refused"):
        take_items(iter([robot()]), Sink("viewer", f"rerun+http://127.0.0.1:{port}/proxy", 1))
