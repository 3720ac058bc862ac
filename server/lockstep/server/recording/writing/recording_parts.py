"""The files of a recording, one after another: when each begins and ends, and with what it begins."""

import shutil
from collections.abc import Callable
from pathlib import Path

import msgspec
import structlog

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.errors import DiskTrouble, RecordingError
from lockstep.server.recording.format.event_index import Ending, EventIndex
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import Degraded, EpisodeRecord, OwnRecord, ParticipantsRecord, SeatRecord
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.reading.scan import complete_file
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, OwnItem, RobotItem, entries_of
from lockstep.server.recording.writing.whole_episodes import WholeEpisodes
from lockstep.server.recording.writing.writer import RecordingWriter

__all__ = ["RecordingParts"]

log = structlog.get_logger(__name__)

REMEMBERED = (SeatRecord, ParticipantsRecord)  # every part begins with these, besides robot and feedback


class RecordingParts:
    """Call `take` and `take_lost` in the order of the items, `flush_if_due` often, and at the end `close` or `fail`.

    One thread calls these; any other one may look at the attributes, the properties and `index`.

    Args:
        on_part: called when a file has begun
        on_episode: called with an episode's id and True when its record `kept` is on the disk, and with False when the
            episode cannot be kept any more because its file has ended
        signing: signs the files; None: they are not signed

    Raises:
        RecordingError, OSError: by `take`, `take_lost`, `flush_if_due` and `close`. Call `fail` then.

    Attributes:
        free_bytes: on the disk, when it was looked at last; 0: not yet
    """

    def __init__(
        self,
        directory: Path,
        settings: RecordingSettings,
        info: RecordingInfo,
        on_part: Callable[[], None],
        on_episode: Callable[[str, bool], None],
        signing: RecordingSigning | None,
    ) -> None:
        self.free_bytes = 0
        self._directory = directory
        self._settings = settings
        self._info = info
        self._on_part = on_part
        self._on_episode = on_episode
        self._signing = signing
        self._episodes = WholeEpisodes()
        self._is_keeping = False  # a record `kept` is written, and not known to be on the disk
        self._head = ""  # of the previous part's signed chain
        self._robot: RobotItem | None = None
        self._remembered: dict[type[OwnRecord], OwnItem] = {}
        self._feedback: FeedbackItem | None = None
        self._writer: RecordingWriter | None = None
        self._part = 0
        self._newest = 0  # ns, arrival of the item taken last
        self._bytes_before = 0  # of earlier parts

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

    def take(self, item: Item) -> None:
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

    def take_lost(self, lost: int) -> None:
        """Write that `lost` items were left out here, and count them."""
        if self._writer is None or self._robot is None:
            return
        self._writer.count_lost(lost)
        event = self._robot.record.event if self._feedback is None else self._feedback.feedback.event
        record = Degraded(epoch=self._robot.record.epoch, event=event, lost=lost)
        self._write(self._writer, OwnItem(self._newest, record), self._robot.record.description)

    def flush_if_due(self, now: int) -> None:
        """Put what is old enough on the disk; `now`: ns, on the recording's clock."""
        if self._writer is not None and self._writer.flush_if_due(now):
            self._look_at_disk()

    def close(self) -> None:
        """End the recording."""
        self._end_file("episodes" if self._episodes.begun else "no_episodes")

    def _end_file(self, ending: Ending) -> None:
        cut = self._episodes.file_ends()
        if cut:
            self._on_episode(cut, False)
        writer = self._writer
        if writer is not None:
            writer.close(ending)
            self._writer = None  # not before: `fail` cuts a file that fails here to its whole records
            self._bytes_before += writer.bytes_written
            self._head = writer.head

    def fail(self, reason: str) -> None:
        """End after a failure. The file is closed if there is room for that, else cut to its whole records."""
        writer, self._writer = self._writer, None
        if writer is None:
            return
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

    def _take_episode(self, item: OwnItem, record: EpisodeRecord, is_open: bool) -> None:
        """Write a record of an episode; say of `kept` that it is on the disk, only when it is."""
        kept = False
        if not is_open or self._writer is None or self._robot is None:
            self._episodes.leaves_out(record)
        elif self._episodes.takes(record):
            self._write(self._writer, item, self._robot.record.description)
            if record.kind == "kept":
                self._is_keeping = True
                self._writer.flush()
                self._is_keeping, kept = False, True
            elif record.kind == "start":
                self._writer.flush()  # so that the next process knows of it, if this one is killed
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
        self._end_file("continued")
        self._begin(item)

    def _begin(self, robot: RobotItem) -> None:
        """Begin a file with the present state."""
        self._look_at_disk()  # else automatic recording, which tries again and again, fills the disk with beginnings
        self._part += 1
        info = msgspec.structs.replace(
            self._info,
            part=self._part,
            epoch=robot.record.epoch,
            robot=robot.record.description.label,
            episodes="begun" if self._episodes.begun else "none",
            cut=self._episodes.cut,
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
            self._end_file("continued")
            self._begin(self._robot)

    def _look_at_disk(self) -> None:
        free = shutil.disk_usage(self._directory).free
        self.free_bytes = free
        if free < self._settings.free_bytes:
            raise DiskTrouble(f"only {free / 1e6:.0f} MB are free on the disk")
