"""Appends each kept episode of recordings to a dataset, as soon as it is on the disk. Blocks. Needs pyarrow.

It belongs into a process of its own, with a low priority: the console writes the recording and knows nothing of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.dataset.appending import append, is_dataset, note_without_rows, read_state
from lockstep.server.recording.dataset.commit import recover
from lockstep.server.recording.dataset.growing import GrowingRecording
from lockstep.server.recording.dataset.removing import remove
from lockstep.server.recording.episodes.edit_rules import apply_edits
from lockstep.server.recording.episodes.edits import edits_version, read_edits
from lockstep.server.recording.errors import DatasetRefused, RecordingError
from lockstep.server.recording.export.export_lerobot import (
    DatasetOptions,
    Say,
    as_a_whole,
    cameras_of,
    left_out,
    new_state,
    no_rows,
    not_as_a_whole,
)
from lockstep.server.recording.export.lerobot_batch import DatasetState
from lockstep.server.recording.export.lerobot_layout import layout_of
from lockstep.server.recording.export.lerobot_present import present
from lockstep.server.recording.export.lerobot_rows import (
    EpisodeRows,
    Stretch,
    check_same_robot,
    rows_of,
    stretches_of,
)
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.whole_recordings import whole_recordings

__all__ = ["DatasetFollower"]

NOT_FOLLOWED = "it has no episodes, and what is followed are kept episodes alone; --append takes it, or says why not"
Key = tuple[str, int, int]  # of a stretch: its episode and its first and last event
FILE: Key = ("", 0, 0)  # the file itself


@dataclass
class _File:
    """What is known of a recording, as long as it is there.

    Attributes:
        edits: version of the changes that were taken into account
        again: it has an episode that could not be written
        passed: stretches that have been said not to fit
        staying: episodes that have been said to stay in the dataset though they were discarded
    """

    growing: GrowingRecording
    edits: tuple[int, int, int] | None = None
    again: bool = False
    passed: set[Key] = field(default_factory=set)
    staying: set[Key] = field(default_factory=set)


class DatasetFollower:
    """Hold the dataset's lock (`alone_with`), then call `look` again and again.

    Args:
        root: the dataset; it begins with the first kept episode
        options: of a new dataset; one that is there already keeps its own
        say: is told each episode that was appended, and what was left out, and why

    Attributes:
        left_out: number of episodes and files that were left out, besides those that the dataset has unchanged

    Raises:
        RecordingError, OSError: there is a dataset that cannot be appended to.
    """

    def __init__(self, root: Path, options: DatasetOptions, say: Say) -> None:
        self.left_out = 0
        self._root = root
        self._options = options
        self._say = say
        self._wholes: Mapping[Path, str] | None = None  # None: files without episodes are left out
        self._state: DatasetState | None = read_state(root) if is_dataset(root) else None
        self._robot: RobotDescription | None = None
        self._files: dict[Path, _File] = {}  # those that were there at the last look
        self._without_rows: list[EpisodeRows] = []  # that the dataset is to note when it begins

    def take_wholes(self, paths: Sequence[Path]) -> None:
        """Append those of these files that have no episodes too, each as one, where `whole_recordings` allows it."""
        has_episodes = self._state is not None and any(each.episode for each in self._state.notes.episodes)
        beside = self._root.name if has_episodes else ""
        self._wholes = whole_recordings(paths, wanted=self._options.whole, beside=beside)

    def look(self, paths: Sequence[Path], since: int = 0) -> int:
        """Append what is new, oldest first; return the number of episodes.

        Args:
            paths: recordings, whole or still written
            since: µs since 1970; episodes that ended before are left out

        Raises:
            RecordingError, OSError: the dataset cannot be read any more.
        """
        count = 0
        for path in sorted(paths, key=_age):
            file = self._files.setdefault(path, _File(GrowingRecording(path)))
            try:
                edits = edits_version(path)
                if file.growing.advance() or file.again or edits != file.edits:
                    file.again = False
                    file.edits = edits
                    count += self._take(file, since)
                if said := self._not_taken(file.growing):
                    self._pass_over(file, FILE, said)
            except RecordingError as error:
                self._pass_over(file, FILE, left_out(path, "", str(error)))
            except FileNotFoundError:
                del self._files[path]  # recordings have a bound, and the oldest are deleted
        for path in self._files.keys() - set(paths):
            if not path.exists():
                del self._files[path]
        return count

    def _not_taken(self, growing: GrowingRecording) -> str:
        """Return in words that a file without episodes is left out; "" if it is not, or is still written."""
        if growing.index.episodes:
            return ""
        if self._wholes is None:
            return left_out(growing.path, "", NOT_FOLLOWED) if growing.ended else ""
        why = self._wholes.get(growing.path, "")
        return not_as_a_whole(growing.path, why) if why else ""

    def _take(self, file: _File, since: int) -> int:
        growing = file.growing
        recorded = growing.index.episodes
        episodes = apply_edits(recorded, read_edits(growing.path)).episodes
        for each in episodes:
            if each.entry.state == "discarded":
                self._take_out(file, each.entry)
        is_whole = not recorded and self._wholes is not None and self._wholes.get(growing.path) == ""
        if not is_whole and not any(each.entry.state == "kept" and each.entry.ended >= since for each in episodes):
            return 0
        with growing.reader() as reader:
            stretches = stretches_of(reader, episodes, self._options.task if is_whole else None)
            new = (each for each in stretches if each.ended >= since and self._is_new(file, each))
            return sum(self._append(reader, each, file) for each in new)

    def _take_out(self, file: _File, entry: EpisodeEntry) -> None:
        """Take what the dataset has of a discarded episode out of it, under whatever id it has it."""
        state, index = self._state, file.growing.index
        key = entry.id, entry.first_event, entry.last_event
        if state is None or key in file.staying:
            return
        events = index.recording, index.epoch, entry.first_event, entry.last_event
        found = [number for number, each in enumerate(state.notes.episodes) if each.shared(*events)]
        if not found:
            return
        name = f"episode {entry.id} of {file.growing.path.name} was discarded"
        try:
            self._state = remove(self._root, state, found)
        except RecordingError as error:
            file.staying.add(key)
            self._say(f"{name}, and stays in {self._root.name}: {error}")
        except OSError as error:
            file.again = True
            self._say(f"{name}, {self._root.name} cannot be written, and is tried again: {error}")
        else:
            left = 0 if self._state is None else len(self._state.notes.episodes)
            self._say(f"{name}, and is taken out of {self._root.name}, which has {left} left")

    def _is_new(self, file: _File, stretch: Stretch) -> bool:
        found = None if self._state is None else present(self._state.notes.episodes, stretch)
        if found is None:
            return _key(stretch) not in file.passed
        if not found.is_same or found.other_task:
            why = found.in_words() + ("" if found.is_same else ", from before a change")
            self._pass_over(file, _key(stretch), left_out(stretch.path, stretch.episode, why))
        return False

    def _append(self, reader: RecordingReader, stretch: Stretch, file: _File) -> bool:
        try:
            rows = self._written(reader, stretch)
        except (RecordingError, OSError) as error:
            if isinstance(error, RecordingError):
                self._pass_over(file, _key(stretch), left_out(stretch.path, stretch.episode, str(error)))
            else:
                file.again = True
                self._say(f"{self._root.name} cannot be written, and is tried again: {error}")
            if self._state is not None:
                recover(self._root)
                self._state = read_state(self._root)
            return False
        out = f", {rows.left_out} events left out" if rows.left_out else ""
        if not stretch.episode:
            self._say(as_a_whole(stretch.path, stretch.task))
        name = f"episode {stretch.episode} of {stretch.path.name}" if stretch.episode else stretch.path.name
        self._say(f"{name}: {len(rows.frames)} rows{out}")
        return True

    def _written(self, reader: RecordingReader, stretch: Stretch) -> EpisodeRows:
        robot, state = reader.description(), self._state
        if self._robot is not None:
            check_same_robot(self._robot, robot)
        if state is not None and state.robot != robot.name:
            raise DatasetRefused(f"the dataset is of another robot: {state.robot}")
        layout = layout_of(robot, self._options.layout if state is None else state.notes.layout)
        topics = cameras_of(reader, self._options.cameras) if state is None else state.notes.topics
        tolerance = self._options.tolerance if state is None else state.notes.tolerance
        fps = self._options.fps if state is None else state.fps if state.notes.has_rate else None
        (rows,) = rows_of(reader, layout, [stretch], topics, tolerance, fps)
        if not rows.frames:
            if state is not None:
                note_without_rows(self._root, state, rows)
            else:
                self._without_rows.append(rows)
            raise DatasetRefused(no_rows(tolerance))
        state = state or new_state(robot, layout, topics, self._options, [rows], self._without_rows)
        append(self._root, state, layout, [rows])
        self._state, self._robot = state, robot
        return rows

    def _pass_over(self, file: _File, key: Key, said: str) -> None:
        if key not in file.passed:
            file.passed.add(key)
            self.left_out += 1
            self._say(said)


def _age(path: Path) -> tuple[str, int]:
    """Return the order of files: their names begin with the time, and from the second part on end with its number."""
    name, _, part = path.stem.rpartition("-p")
    return (name, int(part)) if name and part.isdecimal() and part.isascii() else (path.stem, 1)


def _key(stretch: Stretch) -> Key:
    return stretch.episode, stretch.first_event, stretch.last_event
