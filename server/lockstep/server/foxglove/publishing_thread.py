"""The thread that encodes a session for the Foxglove server. The console's loop only appends to a bounded queue."""

import threading
import time
from collections.abc import Callable, Iterable
from typing import Protocol

from lockstep.server.recording.format.stamp import STAMP_TOPIC, stamp_message
from lockstep.server.recording.format.topics import LOG, Topic, topics_of
from lockstep.server.recording.writing.live_queue import LiveQueue
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, RobotItem, entries_of

__all__ = ["PublishingThread", "TopicServer"]

DRAIN_SECONDS = 0.02  # between two looks at the queue: nobody is woken for each item


class TopicServer(Protocol):
    """The part of the server that is needed here."""

    def advertise(self, topics: Iterable[Topic]) -> None: ...
    def log(self, topic: str, data: bytes, arrived: int) -> None: ...


class PublishingThread:
    """Publishes items as the records that a recording has, and stamps. `put` from the loop at any rate.

    A full queue drops its oldest items, and counts them: viewers want the newest. An item that cannot be encoded is
    left out.

    Attributes:
        watched: whether anybody subscribed; if not, the topics are offered, and nothing is encoded
        repeats: whether the items that are put now are no news: then /log has no line of them
    """

    def __init__(self, server: TopicServer, on_fault: Callable[[Exception], None]) -> None:
        """`on_fault` is called from the thread."""
        self.watched = False
        self.repeats = False
        self._server = server
        self._on_fault = on_fault
        self._waiting = LiveQueue()
        self._robot: RobotItem | None = None  # the newest, which no full queue drops
        self._offered: RobotItem | None = None  # the one whose topics are offered
        self._news = threading.Event()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="foxglove", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def put(self, item: Item) -> None:
        """Queue an item without blocking."""
        if isinstance(item, RobotItem):
            self._robot = item
        elif not self.watched:
            return
        self._waiting.put(item, repeats=self.repeats)
        self._news.set()

    @property
    def dropped(self) -> int:
        """The number of items that were dropped."""
        return self._waiting.dropped

    def lost_pictures(self) -> bool:
        """Return whether a picture or sound was dropped since the last call."""
        lost, self._waiting.dropped_media = self._waiting.dropped_media, False
        return lost

    def close(self) -> None:
        """End, without the waiting items. Blocks; idempotent."""
        self._closing.set()
        self._news.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _run(self) -> None:
        while not self._closing.is_set():
            self._news.wait()
            self._news.clear()
            for _ in range(len(self._waiting)):
                taken = self._waiting.take()
                if taken is None:
                    break
                try:
                    self._publish(*taken)
                except Exception as error:
                    self._on_fault(error)
                time.sleep(0)  # the loop goes first
            self._closing.wait(DRAIN_SECONDS)

    def _publish(self, item: Item, repeated: bool) -> None:
        robot = self._robot
        if robot is None:
            return
        if self._offered is None or not _same_topics(robot, self._offered):
            self._server.advertise([*topics_of(robot.record.description, robot.codecs), STAMP_TOPIC])
        self._offered = robot
        if not self.watched or _epoch(item) != robot.record.epoch:
            return  # joints and axes of another epoch may be those of another description
        for entry in entries_of(item, robot.record.description):
            if not (repeated and entry.topic == LOG):
                self._server.log(entry.topic, entry.data, entry.arrived)
            if isinstance(item, MediaItem):
                self._server.log(STAMP_TOPIC.name, stamp_message(entry, item.epoch), entry.arrived)


def _same_topics(one: RobotItem, other: RobotItem) -> bool:
    return one.record.description == other.record.description and one.codecs == other.codecs


def _epoch(item: Item) -> str:
    return item.epoch if isinstance(item, FeedbackItem | MediaItem) else item.record.epoch
