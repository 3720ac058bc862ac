"""Where the records of a session go: the queue of the recording that runs, if one does."""

import time
from typing import Protocol

from lockstep.server.recording.format.records import OwnRecord
from lockstep.server.recording.times import RecordClock
from lockstep.server.recording.writing.queue_items import Item, OwnItem

__all__ = ["ItemQueue", "RecordSink"]


class ItemQueue(Protocol):
    """The part of a queue of items that is needed here."""

    def put(self, item: Item) -> None: ...


class RecordSink:
    """Passes items on between `open` and `close`, and drops them otherwise.

    Attributes:
        is_open: whether a recording runs
        times: its times of arrival
    """

    def __init__(self) -> None:
        self.is_open = False
        self.times = RecordClock(time.time_ns(), time.monotonic_ns())
        self._queue: ItemQueue | None = None

    def open(self, queue: ItemQueue, times: RecordClock) -> None:
        self._queue, self.times, self.is_open = queue, times, True

    def close(self) -> None:
        self._queue, self.is_open = None, False

    def put(self, item: Item) -> None:
        if self._queue is not None:
            self._queue.put(item)

    def put_own(self, record: OwnRecord) -> None:
        """Put a record that arrives now."""
        if self._queue is not None:
            self._queue.put(OwnItem(self.times.at(time.monotonic()), record))
