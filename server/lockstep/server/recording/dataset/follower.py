"""Appends each kept episode of recordings to a dataset, as soon as it is on the disk. Blocks. Needs pyarrow.

It belongs into a process of its own, with a low priority: the console writes the recording and knows nothing of it.
"""

from collections.abc import Sequence
from pathlib import Path

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.dataset.appending import append, is_dataset, is_in, note_without_rows, read_state
from lockstep.server.recording.dataset.commit import recover
from lockstep.server.recording.dataset.growing import GrowingRecording
from lockstep.server.recording.episodes.edits import edited, read_edits
from lockstep.server.recording.errors import DatasetRefused, RecordingError
from lockstep.server.recording.export.export_lerobot import (
    DatasetOptions,
    Say,
    cameras_of,
    left_out,
    new_state,
    no_rows,
)
from lockstep.server.recording.export.lerobot_batch import DatasetState
from lockstep.server.recording.export.lerobot_layout import layout_of
from lockstep.server.recording.export.lerobot_rows import (
    EpisodeRows,
    Stretch,
    check_same_robot,
    rows_of,
    stretches_of,
)
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["DatasetFollower"]


class DatasetFollower:
    """Hold the dataset's lock (`alone_with`), then call `look` again and again.

    Args:
        root: the dataset; it begins with the first kept episode
        options: of a new dataset; one that is there already keeps its own
        say: is told each episode that was appended, and what was left out, and why

    Raises:
        RecordingError, OSError: there is a dataset that cannot be appended to.
    """

    def __init__(self, root: Path, options: DatasetOptions, say: Say) -> None:
        self._root = root
        self._options = options
        self._say = say
        self._state: DatasetState | None = read_state(root) if is_dataset(root) else None
        self._robot: RobotDescription | None = None
        self._files: dict[Path, GrowingRecording] = {}
        self._passed: set[tuple[Path, str]] = set()  # episodes that have been said not to fit
        self._without_rows: list[EpisodeRows] = []  # that the dataset is to note when it begins
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
        for path in sorted(paths, key=lambda each: each.name):  # the names begin with the time
            growing = self._files.setdefault(path, GrowingRecording(path))
            try:
                if growing.advance() or path in self._again:
                    self._again.discard(path)
                    count += self._take(growing, since)
            except RecordingError as error:
                self._pass_over(path, "", str(error))
            except FileNotFoundError:
                del self._files[path]  # recordings have a bound, and the oldest are deleted
        return count

    def _take(self, growing: GrowingRecording, since: int) -> int:
        episodes = edited(growing.index.episodes, read_edits(growing.path))
        kept = [each for each in episodes if each.state == "kept" and each.ended >= since]
        if not kept:
            return 0
        with growing.reader() as reader:
            fresh = [stretch for stretch in stretches_of(reader, kept, "") if self._is_new(stretch)]
            return sum(self._append(reader, stretch, growing) for stretch in fresh)

    def _is_new(self, stretch: Stretch) -> bool:
        has = self._state is not None and is_in(self._state, stretch)
        return not has and (stretch.path, stretch.episode) not in self._passed

    def _append(self, reader: RecordingReader, stretch: Stretch, growing: GrowingRecording) -> bool:
        try:
            rows = self._written(reader, stretch, growing)
        except (RecordingError, OSError) as error:
            if isinstance(error, RecordingError):
                self._pass_over(stretch.path, stretch.episode, str(error))
            else:
                self._again.add(growing.path)
                self._say(f"{self._root.name} cannot be written, and is tried again: {error}")
            if self._state is not None:
                recover(self._root)
                self._state = read_state(self._root)
            return False
        out = f", {rows.left_out} events left out" if rows.left_out else ""
        self._say(f"episode {stretch.episode} of {stretch.path.name}: {len(rows.frames)} rows{out}")
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

    def _pass_over(self, path: Path, episode: str, why: str) -> None:
        if (path, episode) not in self._passed:
            self._passed.add((path, episode))
            self._say(left_out(path, episode, why))
