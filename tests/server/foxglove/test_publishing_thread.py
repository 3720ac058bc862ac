"""What the thread offers and publishes, and what it drops when the server holds it up."""

import threading
from collections.abc import Iterable

from lockstep.server.foxglove.publishing_thread import PublishingThread
from lockstep.server.recording.format.records import NoteRecord, RobotRecord
from lockstep.server.recording.format.topics import OWN_TOPICS, Topic
from lockstep.server.recording.writing.live_queue import MAX_ITEMS
from lockstep.server.recording.writing.queue_items import MediaItem, OwnItem, RobotItem
from tests.server.recording.makers import CODECS, DESCRIPTION, EPOCH, START
from tests.waiting import PATIENCE

NOTE = OWN_TOPICS[NoteRecord]


class Server:
    """Keeps what it gets; holds the thread up while `go` is cleared."""

    def __init__(self) -> None:
        self.go = threading.Event()
        self.go.set()
        self.entered = threading.Event()
        self.offers: list[list[str]] = []
        self.logged: list[tuple[str, bytes]] = []
        self.done = threading.Event()

    def advertise(self, topics: Iterable[Topic]) -> None:
        self.offers.append([topic.name for topic in topics])

    def log(self, topic: str, data: bytes, arrived: int) -> None:
        self.entered.set()
        assert self.go.wait(PATIENCE)
        self.logged.append((topic, data))
        if b"the last" in data:
            self.done.set()

    def of(self, topic: str) -> list[bytes]:
        return [data for name, data in self.logged if name == topic]


def note(text: str, epoch: str = EPOCH) -> OwnItem:
    return OwnItem(START, NoteRecord(epoch=epoch, event=1, peer="p", name="Ada", role="operator", text=text))


def robot(epoch: str = EPOCH) -> RobotItem:
    record = RobotRecord(epoch=epoch, event=1, link="up", description=DESCRIPTION)
    return RobotItem(START, record, CODECS)


def fail(error: Exception) -> None:
    raise error


def test_a_server_that_holds_the_thread_up_costs_the_oldest_items_and_never_the_one_who_puts() -> None:
    server = Server()
    thread = PublishingThread(server, fail)
    thread.start()
    try:
        thread.put(robot())
        thread.watched = True
        server.go.clear()
        thread.put(note("held up"))
        assert server.entered.wait(PATIENCE)
        for number in range(MAX_ITEMS):
            thread.put(note(f"note {number}"))
        for _ in range(10):
            thread.put(note("newer"))
        thread.put(note("the last"))
        assert thread.dropped >= 11
        server.go.set()
        assert server.done.wait(PATIENCE)
    finally:
        server.go.set()
        thread.close()
    texts = b"".join(server.of(NOTE))
    assert b"note 0" not in texts
    assert f"note {MAX_ITEMS - 1}".encode() in texts
    assert texts.count(b"newer") == 10


def test_topics_are_offered_once_and_nothing_is_published_while_nobody_watches() -> None:
    server = Server()
    thread = PublishingThread(server, fail)
    thread.start()
    thread.put(note("unwatched"))
    thread.put(robot())
    thread.put(robot("epoch-2"))
    thread.watched = True
    thread.put(note("of another epoch"))
    thread.put(note("the last", "epoch-2"))
    assert server.done.wait(PATIENCE)
    thread.close()
    (offer,) = server.offers
    assert {NOTE, "/camera/front", "/microphone/ear", "/joint_states", "/odom", "/lockstep/stamp"} <= set(offer)
    assert "/lockstep/signature" not in offer
    assert len(server.of(NOTE)) == 1


def test_what_is_repeated_is_no_news_and_has_no_line_in_the_log() -> None:
    server = Server()
    thread = PublishingThread(server, fail)
    thread.start()
    thread.watched = True
    thread.repeats = True
    thread.put(robot())
    thread.put(note("known"))
    thread.repeats = False
    thread.put(note("the last"))
    assert server.done.wait(PATIENCE)
    thread.close()
    assert len(server.of(NOTE)) == 2
    assert all(b"known" not in line for line in server.of("/log"))


def test_an_item_that_cannot_be_encoded_is_told_and_the_next_goes_on() -> None:
    server, faults = Server(), list[Exception]()
    thread = PublishingThread(server, faults.append)
    thread.start()
    thread.put(robot())
    thread.watched = True
    thread.put(MediaItem(START, START, EPOCH, "ear", "no codec", 1, True, b""))
    thread.put(note("the last"))
    assert server.done.wait(PATIENCE)
    thread.close()
    thread.close()
    assert [type(each) for each in faults] == [KeyError]
