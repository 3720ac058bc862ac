"""What the thread hands over, and what it drops while the process does not read."""

import os
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest

from lockstep.server.recording.format.records import NoteRecord, RobotRecord
from lockstep.server.recording.writing.live_queue import MAX_ITEMS
from lockstep.server.recording.writing.queue_items import Item, MediaItem, OwnItem, RobotItem
from lockstep.server.rerun.feed import Feed
from tests.server.recording.makers import CODECS, DESCRIPTION, EPOCH, START
from tests.waiting import PATIENCE

pytest.importorskip("rerun")
from lockstep.server.rerun.rerun_process import Pipe

ROBOT = RobotItem(START, RobotRecord(epoch=EPOCH, event=1, link="up", description=DESCRIPTION), CODECS)


def note(text: str) -> OwnItem:
    return OwnItem(START, NoteRecord(epoch=EPOCH, event=1, peer="p", name="Ada", role="operator", text=text))


def picture(size: int) -> MediaItem:
    return MediaItem(START, START, EPOCH, "front", "H264", 1, True, bytes(size))


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    yield reading, writing
    for each in (reading, writing):
        with suppress(OSError):
            os.close(each)


def taken(reading: int) -> list[Item]:
    return [item for item in Pipe(reading) if item is not None]


def test_items_arrive_whole_and_in_order_and_the_end_follows_the_last(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    feed = Feed(writing)
    items: list[Item] = [ROBOT, *(note(f"{number}") for number in range(50)), picture(300_000), note("the last")]
    feed.start()
    for item in items:
        feed.put(item)
    feed.close()
    assert taken(reading) == items
    feed.join()
    assert feed.dropped == 0
    assert not feed.broken.is_set()


def test_a_process_that_does_not_read_costs_the_oldest_items_but_never_the_robot(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    feed = Feed(writing)
    feed.start()
    feed.put(picture(1_000_000))  # more than a pipe holds: the thread is held up
    while feed.blocked_for(1e9) == 0:
        pass
    feed.put(ROBOT)
    feed.put(picture(1))
    for number in range(2 * MAX_ITEMS):
        feed.put(note(f"{number}"))
    assert feed.dropped == MAX_ITEMS + 2
    assert feed.lost_pictures()
    feed.close()
    first, robot, *rest = taken(reading)
    feed.join()
    assert isinstance(first, MediaItem)
    assert robot == ROBOT
    assert rest == [note(f"{number}") for number in range(MAX_ITEMS, 2 * MAX_ITEMS)]
    assert feed.blocked_for(1e9) == 0


def test_the_end_of_the_process_ends_the_thread(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    feed = Feed(writing)
    feed.start()
    os.close(reading)
    feed.put(note("nobody reads"))
    assert feed.broken.wait(PATIENCE)
    feed.close()
    feed.join()
    assert not [each for each in threading.enumerate() if each.name == "rerun"]


def test_a_feed_that_never_began_closes_its_pipe(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    feed = Feed(writing)
    feed.close()
    feed.join()
    assert os.read(reading, 1) == b""
