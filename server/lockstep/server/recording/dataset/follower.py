"""Appends each kept episode of recordings to a dataset, as soon as it is on the disk. Blocks. Needs pyarrow.

It belongs into a process of its own, with a low priority: the console writes the recording and knows nothing of it.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.dataset.appending import append, is_dataset, note_without_rows, present, read_state
from lockstep.server.recording.dataset.commit import recover
from lockstep.server.recording.dataset.growing import GrowingRecording
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
from lockstep.server.recording.export.lerobot_rows import (
    EpisodeRows,
    Stretch,
    check_same_robot,
    rows_of,
    stretches_of,
    whole_stretch,
)
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["DatasetFollower"]

NOT_LOOKED_AT = "what is followed are kept episodes alone; --append may take it"


class DatasetFollower:
    """Hold the dataset's lock (`alone_with`), then call `look` again and again.

    Args:
        root: the dataset; it begins with the first kept episode
        options: of a new dataset; one that is there already keeps its own
        say: is told each episode that was appended, and what was left out, and why
        wholes: of files without episodes, why each is not one as a whole, "" if it is; of others none is

    Attributes:
        left_out: number of episodes and files that were left out, besides those that the dataset has unchanged

    Raises:
        RecordingError, OSError: there is a dataset that cannot be appended to.
    """

    def __init__(self, root: Path, options: DatasetOptions, say: Say, wholes: Mapping[Path, str] | None = None) -> None:
        self.left_out = 0
        self._root = root
        self._options = options
        self._say = say
        self._wholes = wholes or {}
        self._state: DatasetState | None = read_state(root) if is_dataset(root) else None
        self._robot: RobotDescription | None = None
        self._files: dict[Path, GrowingRecording] = {}
        self._passed: set[tuple[Path, str, int, int]] = set()  # stretches that have been said not to fit
        self._discarded: set[tuple[Path, str, int, int]] = set()  # that have been said to stay in the dataset
        self._without_rows: list[EpisodeRows] = []  # that the dataset is to note when it begins
        self._edits: dict[Path, tuple[int, int, int]] = {}  # versions of the changes that were taken into account
        self._again: set[Path] = set()  # recordings with an episode that could not be written

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
            growing = self._files.setdefault(path, GrowingRecording(path))
            try:
                edits = edits_version(path)
                if growing.advance() or path in self._again or edits != self._edits.get(path):
                    self._again.discard(path)
                    self._edits[path] = edits
                    count += self._take(growing, since)
                if why := self._why_not_whole(growing):
                    self._pass_over((path, "", 0, 0), not_as_a_whole(path, why))
            except RecordingError as error:
                self._pass_over((path, "", 0, 0), left_out(path, "", str(error)))
            except FileNotFoundError:
                del self._files[path]  # recordings have a bound, and the oldest are deleted
        return count

    def _why_not_whole(self, growing: GrowingRecording) -> str:
        """Return why a file without episodes is left out; "" if it is not, or is still written."""
        if growing.index.episodes:
            return ""
        return self._wholes.get(growing.path, NOT_LOOKED_AT if growing.ended else "")

    def _take(self, growing: GrowingRecording, since: int) -> int:
        recorded = growing.index.episodes
        episodes = apply_edits(recorded, read_edits(growing.path)).episodes
        self._name_discarded(growing, [each.entry for each in episodes if each.entry.state == "discarded"])
        kept = [each for each in episodes if each.entry.state == "kept" and each.entry.ended >= since]
        is_whole = not recorded and self._wholes.get(growing.path) == ""
        if not kept and not is_whole:
            return 0
        with growing.reader() as reader:
            stretches = [whole_stretch(reader, self._options.task)] if is_whole else stretches_of(reader, kept)
            return sum(self._append(reader, each, growing) for each in stretches if self._is_new(each))

    def _name_discarded(self, growing: GrowingRecording, discarded: Sequence[EpisodeEntry]) -> None:
        """Say once of each episode that was discarded after it was appended that the dataset has it."""
        noted = [] if self._state is None else self._state.notes.episodes
        part = growing.index.recording, growing.index.part, growing.index.epoch
        names = {each.episode for each in noted if (each.recording, each.part, each.epoch) == part}
        for each in discarded:
            key = (growing.path, each.id, each.first_event, each.last_event)
            if each.id in names and key not in self._discarded:
                self._discarded.add(key)
                self._say(f"episode {each.id} of {growing.path.name} was discarded, and stays in {self._root.name}")

    def _is_new(self, stretch: Stretch) -> bool:
        found = None if self._state is None else present(self._state.notes, stretch)
        if found is None:
            return _key(stretch) not in self._passed
        if not found.is_same:
            names = ", ".join(each.episode or "a whole recording" for each in found.episodes)
            count = event_gap(stretch.last_event, stretch.first_event)
            why = f"the dataset has {found.events} of its {count} events already, as {names}, from before a change"
            self._pass_over(_key(stretch), left_out(stretch.path, stretch.episode, why))
        return False

    def _append(self, reader: RecordingReader, stretch: Stretch, growing: GrowingRecording) -> bool:
        try:
            rows = self._written(reader, stretch, growing)
        except (RecordingError, OSError) as error:
            if isinstance(error, RecordingError):
                self._pass_over(_key(stretch), left_out(stretch.path, stretch.episode, str(error)))
            else:
                self._again.add(growing.path)
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

    def _written(self, reader: RecordingReader, stretch: Stretch, growing: GrowingRecording) -> EpisodeRows:
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

    def _pass_over(self, key: tuple[Path, str, int, int], said: str) -> None:
        if key not in self._passed:
            self._passed.add(key)
            self.left_out += 1
            self._say(said)


def _age(path: Path) -> tuple[str, int]:
    """Return the order of files: their names begin with the time, and from the second part on end with its number."""
    name, _, part = path.stem.rpartition("-p")
    return (name, int(part)) if name and part.isdecimal() and part.isascii() else (path.stem, 1)


def _key(stretch: Stretch) -> tuple[Path, str, int, int]:
    return stretch.path, stretch.episode, stretch.first_event, stretch.last_event
