"""The thread that writes a recording. The console's loop only appends to a bounded queue."""

import shutil
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec
import structlog

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.errors import DiskTrouble, RecordingError
from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import Degraded, EpisodeRecord, OwnRecord, ParticipantsRecord, SeatRecord
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.reading.scan import complete_file
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing.live_queue import size_of
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, OwnItem, RobotItem, entries_of
from lockstep.server.recording.writing.whole_episodes import WholeEpisodes
from lockstep.server.recording.writing.writer import RecordingWriter

__all__ = ["RecordingThread"]

log = structlog.get_logger(__name__)

MAX_WAITING = 4096  # items, 15 s and more
MAX_BYTES = 128_000_000  # of the waiting items, about: 15 s at 68 Mbit/s
DRAIN_SECONDS = 0.05  # between two looks at the queue: nobody is woken for each item
REMEMBERED = (SeatRecord, ParticipantsRecord)  # every part begins with these, besides robot and feedback


class Lost(NamedTuple):
    """Stands in the queue where items were left out."""

    items: int


class RecordingThread:
    """Writes a recording. `put` from the loop at any rate; `close` from another thread, which waits for the end.

    Args:
        now: ns since 1970 on the recording's clock
        on_part: called from the thread when a file has begun
        on_end: called from the thread when it ends by itself
        on_episode: called from the thread with an episode's id and True when its record `kept` is on the disk, and
            with False when the episode cannot be kept any more because its file has ended
        signing: signs the files; None: they are not signed

    Attributes:
        failure: why it ended by itself; "" while it runs, or when it was closed
    """

    def __init__(
        self,
        directory: Path,
        settings: RecordingSettings,
        info: RecordingInfo,
        now: Callable[[], int],
        on_part: Callable[[], None],
        on_end: Callable[[], None],
        signing: RecordingSigning | None = None,
        on_episode: Callable[[str, bool], None] = lambda episode, kept: None,
    ) -> None:
        self.info = info
        self.failure = ""
        self._directory = directory
        self._settings = settings
        self._now = now
        self._on_part = on_part
        self._on_end = on_end
        self._signing = signing
        self._on_episode = on_episode
        self._episodes = WholeEpisodes()
        self._is_keeping = False  # a record `kept` is written, and not known to be on the disk
        self.free_bytes = 0  # on the disk, when it was looked at last; 0: not yet
        self._head = ""  # of the previous part's signed chain
        self._waiting: deque[Item | Lost] = deque()
        self._put_bytes = 0  # by the loop alone
        self._taken_bytes = 0  # by the thread alone
        self._lost = 0  # not in the file yet; the loop adds, the thread takes
        self._lost_ever = 0
        self._closing = threading.Event()
        self._robot: RobotItem | None = None
        self._remembered: dict[type[OwnRecord], OwnItem] = {}
        self._feedback: FeedbackItem | None = None
        self._writer: RecordingWriter | None = None
        self._part = 0
        self._newest = 0  # ns, arrival of the item taken last
        self._bytes_before = 0  # of earlier parts
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def put(self, item: Item) -> None:
        """Queue an item without blocking. When the disk is too slow, it is left out and counted.

        The begin and the end of an episode always find a place: a person has caused each of them, and the end decides.
        They come a few times a second at most. Marks do not: stops and changes of the seat cause them too.
        """
        decides = isinstance(item, OwnItem) and isinstance(item.record, EpisodeRecord) and item.record.kind != "mark"
        size = size_of(item)
        is_full = len(self._waiting) >= MAX_WAITING or (self._waiting and self._waiting_bytes + size > MAX_BYTES)
        if is_full and not decides:
            self._lost += 1
            self._lost_ever += 1
            return
        if self._lost:  # what was left out has its place in front of what follows
            lost, self._lost = self._lost, 0
            self._waiting.append(Lost(lost))
        self._put_bytes += size
        self._waiting.append(item)

    def close(self) -> None:
        """Write the waiting items, and end. Blocks; idempotent."""
        self._closing.set()
        if self._thread.ident is not None:
            self._thread.join()

    @property
    def running(self) -> bool:
        return self._thread.is_alive()

    @property
    def lost(self) -> int:
        """The number of records that were left out."""
        return self._lost_ever

    @property
    def waiting(self) -> float:
        """The share of the queue that is taken, 0 to 1."""
        return min(1.0, max(len(self._waiting) / MAX_WAITING, self._waiting_bytes / MAX_BYTES))

    @property
    def _waiting_bytes(self) -> int:
        return self._put_bytes - self._taken_bytes

    @property
    def bytes_written(self) -> int:
        writer = self._writer
        return self._bytes_before + (writer.bytes_written if writer is not None else 0)

    @property
    def path(self) -> Path | None:
        """The path of the file that is being written, or None."""
        writer = self._writer
        return None if writer is None else writer.path

    def index(self) -> EventIndex | None:
        """Return the index of the file that is being written, as far as it is on the disk."""
        writer = self._writer
        return None if writer is None else writer.index()

    def _run(self) -> None:
        try:
            while not self._closing.wait(DRAIN_SECONDS):
                self._drain()
            self._drain()
            self._end_part()
        except (RecordingError, OSError) as error:
            self._fail(str(error))
        except Exception as error:
            log.exception("the recording failed")
            self._fail(f"{type(error).__name__}: {error}")

    def _drain(self) -> None:
        for _ in range(len(self._waiting)):
            item = self._waiting.popleft()
            if isinstance(item, Lost):
                if self._writer is not None:
                    self._tell_lost(self._writer, item.items)
            else:
                self._take(item)
                self._taken_bytes += size_of(item)
            time.sleep(0)  # the loop goes first
        writer = self._writer
        if writer is None:
            return
        if self._lost and not self._waiting:
            lost, self._lost = self._lost, 0
            self._tell_lost(writer, lost)
        if writer.flush_if_due(self._now()):
            self._look_at_disk()

    def _take(self, item: Item) -> None:
        """Write an item. Records of another epoch than the file's belong into no file."""
        self._newest = max(self._newest, item.arrived)
        match item:
            case RobotItem():
                self._meet_robot(item)
                return
            case FeedbackItem():
                self._feedback = item
                epoch = item.epoch
            case MediaItem():
                epoch = item.epoch
            case OwnItem(record=record):
                epoch = record.epoch
                if isinstance(record, REMEMBERED):
                    self._remembered[type(record)] = item
        is_open = self._writer is not None and self._robot is not None and epoch == self._robot.record.epoch
        if isinstance(item, OwnItem) and isinstance(item.record, EpisodeRecord):
            self._take_episode(item, item.record, is_open)
        elif self._writer is not None and self._robot is not None and is_open:
            self._write(self._writer, item, self._robot.record.description)

    def _take_episode(self, item: OwnItem, record: EpisodeRecord, is_open: bool) -> None:
        """Write a record of an episode; say of `kept` that it is on the disk, only when it is."""
        kept = False
        if self._writer is not None and self._robot is not None and is_open and self._episodes.takes(record):
            self._write(self._writer, item, self._robot.record.description)
            if record.kind == "kept":
                self._is_keeping = True
                self._writer.flush()
                self._is_keeping, kept = False, True
        if record.kind == "kept":
            self._on_episode(record.episode, kept)

    def _meet_robot(self, item: RobotItem) -> None:
        before, self._robot = self._robot, item
        same_file = (
            before is not None
            and before.record.epoch == item.record.epoch
            and before.record.description == item.record.description
            and before.codecs == item.codecs
        )
        if same_file and self._writer is not None:
            self._write(self._writer, item, item.record.description)
            return
        self._end_part()
        self._begin_part(item)

    def _begin_part(self, robot: RobotItem) -> None:
        """Begin a file with the present state."""
        self._look_at_disk()  # else automatic recording, which tries again and again, fills the disk with beginnings
        self._part += 1
        info = msgspec.structs.replace(
            self.info, part=self._part, epoch=robot.record.epoch, robot=robot.record.description.label
        )
        suffix = f"-p{self._part}" if self._part > 1 else ""
        writer = RecordingWriter(
            self._directory / f"{info.recording}{suffix}.mcap",
            info,
            robot.record.description,
            robot.codecs,
            self._signing,
            self._head,
        )
        self._writer = writer
        now, epoch, event = self._newest, robot.record.epoch, robot.record.event
        head: list[Item] = []
        if self._feedback is not None and self._feedback.epoch == epoch:
            event = self._feedback.feedback.event
            head.append(self._feedback._replace(arrived=now))
        for known in self._remembered.values():
            head.insert(0, OwnItem(now, msgspec.structs.replace(known.record, epoch=epoch, event=event)))
        head.insert(0, robot._replace(arrived=now, record=msgspec.structs.replace(robot.record, event=event)))
        for item in head:
            self._write(writer, item, robot.record.description)
        self._on_part()

    def _write(self, writer: RecordingWriter, item: Item, description: RobotDescription) -> None:
        for entry in entries_of(item, description):
            writer.write(entry)
        # A file is as long as two, rather than cut an episode.
        most = self._settings.file_bytes * (2 if self._episodes.open else 1)
        if writer.bytes_written >= most and self._robot is not None:
            self._end_part()
            self._begin_part(self._robot)

    def _end_part(self) -> None:
        writer = self._writer
        cut = self._episodes.file_ends()
        if cut:
            self._on_episode(cut, False)
        if writer is not None:
            writer.close()
            self._writer = None  # not before: `_fail` cuts a file that fails here to its whole records
            self._bytes_before += writer.bytes_written
            self._head = writer.head

    def _tell_lost(self, writer: RecordingWriter, lost: int) -> None:
        writer.count_lost(lost)
        if self._robot is not None:
            event = self._robot.record.event if self._feedback is None else self._feedback.feedback.event
            record = Degraded(epoch=self._robot.record.epoch, event=event, lost=lost)
            self._write(writer, OwnItem(self._newest, record), self._robot.record.description)

    def _look_at_disk(self) -> None:
        free = shutil.disk_usage(self._directory).free
        self.free_bytes = free
        if free < self._settings.free_bytes:
            raise DiskTrouble(f"only {free / 1e6:.0f} MB are free on the disk")

    def _fail(self, reason: str) -> None:
        """End after a failure. The file is closed if there is room for that, else cut to its whole records."""
        self.failure = reason
        log.error("the recording ended", reason=reason)
        writer, self._writer = self._writer, None
        if writer is not None:
            self._bytes_before += writer.bytes_written
            try:
                if self._is_keeping:  # else a second try could keep an episode that everyone is told is lost
                    raise DiskTrouble(reason)
                writer.close()
            except RecordingError:
                writer.abandon()
                try:
                    complete_file(writer.path, writer.info)
                except (RecordingError, OSError) as error:
                    log.error("the recording is completed at the next start", reason=str(error))
        self._on_end()
