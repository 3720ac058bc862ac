"""A session that is recorded as by a console: driving, episodes, further parts and epochs."""

import os
from pathlib import Path

import msgspec

from lockstep.protocol.messages import Feedback
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import CommandRecord, EpisodeRecord, RobotRecord
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, OwnItem, RobotItem
from lockstep.server.recording.writing.recording_parts import RecordingParts
from tests.server.recording.makers import DESCRIPTION, INTERVAL, START

__all__ = ["Range", "WrittenSession"]

Range = tuple[str, int, int]  # epoch, first event, last event
ROBOT = msgspec.structs.replace(DESCRIPTION, cameras=())
FILE_BYTES = 1_000_000


class WrittenSession:
    """Call its methods in the order of the session, and `close` or `fail` at the end. Commands say their event / 1000.

    Attributes:
        kept: the ranges of the episodes that are said to be kept on the disk
        open: id of the episode that a person has begun and not ended; "" for none
    """

    def __init__(self, directory: Path, recording: str = "r") -> None:
        self.directory = directory
        self.kept: list[Range] = []
        self.open = ""
        self._begun: dict[str, tuple[str, int]] = {}
        self._epoch, self._event = 0, 0
        self._at = START
        self._parts = RecordingParts(
            directory,
            RecordingSettings(free_bytes=0, file_bytes=FILE_BYTES),
            RecordingInfo(recording=recording),
            lambda: None,
            self._on_episode,
            None,
        )
        self.epoch()

    @property
    def paths(self) -> list[Path]:
        return sorted(self.directory.glob("*.mcap"), key=lambda path: (len(path.stem), path.stem))  # parts are few

    def drive(self, events: int = 3) -> None:
        for _ in range(events):
            self._event += 1
            event, epoch = self._event, str(self._epoch)
            values: list[float | None] = [event / 1000, 0.0]
            command = CommandRecord(
                epoch=epoch, event=event, issue=1, values=values, peer="p1", name="Ada", outcome="forwarded"
            )
            feedback = Feedback(event=event, issue=1, time=event / 25, axes=[0.0, 0.0], joints=[1.0, 2.0, 3.0])
            self._take(OwnItem(self._at, command))
            self._take(FeedbackItem(self._at, self._at, epoch, feedback))

    def start(self) -> None:
        self.end("discarded")
        self.open = f"e{len(self._begun)}"
        self._begun[self.open] = str(self._epoch), self._event
        self._episode("start")
        self.drive()

    def end(self, kind: str) -> None:
        if self.open:
            self.drive()
            self._episode(kind)
            self.open = ""

    def rollover(self) -> None:
        """Begin another part, however long an episode may make the present one."""
        before = self._parts.path
        while self._parts.path == before:
            sound = os.urandom(FILE_BYTES + 100_000)
            self._take(MediaItem(self._at, self._at, str(self._epoch), "ear", "opus", self._event, True, sound))
        self.drive()

    def epoch(self) -> None:
        """The bridge begins anew: events begin anew too, and an open episode ends there."""
        self._epoch += 1
        self._event = 0
        record = RobotRecord(epoch=str(self._epoch), event=1, link="up", description=ROBOT)
        self._take(RobotItem(self._at, record, {"ear": "opus"}))
        if self.open:
            self._episode("cut")
            self.open = ""
        self.drive()

    def flush(self) -> None:
        self._parts.flush_if_due(self._at + 10 * INTERVAL * 25)

    def close(self) -> None:
        self._parts.close()

    def fail(self) -> None:
        self._parts.fail("the disk is full")

    def _episode(self, kind: str) -> None:
        epoch, first = self._begun[self.open]
        record = EpisodeRecord(
            epoch=epoch,
            event=self._event or first,
            episode=self.open,
            number=1,
            kind=kind,  # type: ignore[arg-type]
            task="push",
            first_event=first,
            last_event=self._event or first,
        )
        self._take(OwnItem(self._at, record))

    def _take(self, item: Item) -> None:
        self._at += INTERVAL // 10
        self._parts.take(item._replace(arrived=self._at))

    def _on_episode(self, episode: str, kept: bool) -> None:
        if kept:
            self.kept.append((*self._begun[episode], self._event))
