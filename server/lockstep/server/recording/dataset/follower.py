"""Appends each kept episode of recordings to a dataset, as soon as it is on the disk. Blocks. Needs pyarrow.

It belongs into a process of its own, with a low priority: the console writes the recording and knows nothing of it.
"""

import errno
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import msgspec

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.dataset.appending import append, is_dataset, note_without_rows, notes_of_none, read_state
from lockstep.server.recording.dataset.commit import recover
from lockstep.server.recording.dataset.growing import GrowingRecording
from lockstep.server.recording.dataset.kept_options import check_options
from lockstep.server.recording.dataset.removing import event_range, remove
from lockstep.server.recording.episodes.edit_rules import EditedEpisode, apply_edits
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
    why_not_wanted,
)
from lockstep.server.recording.export.lerobot_batch import DatasetState
from lockstep.server.recording.export.lerobot_layout import DatasetLayout, layout_of
from lockstep.server.recording.export.lerobot_meta import DatasetNotes, EventRange
from lockstep.server.recording.export.lerobot_present import present
from lockstep.server.recording.export.lerobot_rows import (
    EpisodeRows,
    Stretch,
    check_same_robot,
    rows_of,
    stretches_of,
)
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.whole_recordings import whole_recordings

__all__ = ["DatasetFollower"]

NOT_FOLLOWED = "it has no episodes, and what is followed are kept episodes alone; --append takes it, or says why not"
DISCARDED = "it was discarded, in another copy of the recording"
MOST_TROUBLES = 20  # that are said in a row, so that words that differ each time have an end
FULL = (errno.ENOSPC, errno.EDQUOT)
Key = tuple[str, int, int, str]  # of a stretch: its episode, its first and last event, and why it is not wanted
FILE: Key = ("", 0, 0, "")  # the file itself


@dataclass
class _File:
    """What is known of a recording, as long as it is there.

    Attributes:
        edits: version of the changes that were taken into account
        episodes: with all changes
        again: it has an episode that could not be written, or may fit by now
        passed: stretches that have been said not to fit
    """

    growing: GrowingRecording
    edits: tuple[int, int, int] | None = None
    episodes: list[EditedEpisode] = field(default_factory=list)
    again: bool = False
    passed: set[Key] = field(default_factory=set)

    @property
    def discarded(self) -> Iterator[EventRange]:
        """Yield the bounds of episodes that were kept once and are no more: only such a one can be in a dataset.

        Whatever it was trimmed to, no other episode has events of these.
        """
        index = self.growing.index
        for each in self.episodes:
            if each.is_dropped:
                yield event_range(index.recording, index.epoch, each.first_bound, each.last_bound)


class _Troubles:
    """Why a dataset cannot be written: said once, and not at every look."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._said: set[str] = set()  # since it could be written

    def say(self, said: str) -> None:
        if said not in self._said and len(self._said) < MOST_TROUBLES:
            self._said.add(said)
            self._say(said)

    def end(self) -> None:
        """It was written."""
        self._said.clear()


class DatasetFollower:
    """Hold the dataset's lock (`alone_with`), then call `look` again and again.

    Args:
        root: the dataset; it begins with the first kept episode
        options: of a new dataset; one that is there already keeps its own, and refuses others
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
        self._emptied: DatasetNotes | None = None  # of a dataset without episodes, which the next one begins anew
        emptied = notes_of_none(root)
        notes = self._state.notes if self._state is not None else emptied
        if notes is not None:
            check_options(root.name, options, notes, {} if self._state is None else self._state.info)
        self._begin_anew(emptied)
        self._robot: RobotDescription | None = None
        self._files: dict[Path, _File] = {}  # those that were there at the last look
        self._without_rows: list[EpisodeRows] = []  # that the dataset is to note when it begins
        self._discarded: Sequence[EventRange] = ()  # of all files at the last look
        self._staying: set[EventRange] = set()  # of which it was said that they cannot be taken out
        self._owes_removal = False  # the disk was full
        self._troubles = _Troubles(say)

    def take_wholes(self, paths: Sequence[Path]) -> None:
        """Append those of these files that have no episodes too, each as one, where `whole_recordings` allows it."""
        has_episodes = self._state is not None and any(each.episode for each in self._state.notes.episodes)
        beside = self._root.name if has_episodes else ""
        self._wholes = whole_recordings(paths, wanted=self._options.whole, beside=beside)

    def look(self, paths: Sequence[Path], since: int = 0) -> int:
        """Take out what was discarded, then append what is new, oldest first; return the number of appended episodes.

        Args:
            paths: recordings, whole or still written
            since: µs since 1970; episodes that ended before are not appended, but where the dataset had events of them

        Raises:
            RecordingError, OSError: the dataset cannot be read any more.
        """
        wanted = [self._files.setdefault(path, _File(GrowingRecording(path))) for path in sorted(paths, key=_age)]
        changed = [file for file in wanted if self._with_care(file, partial(self._read, file))]
        if changed or self._owes_removal:
            self._take_out([each for file in wanted for each in file.discarded], wanted)
        count = 0
        for file in wanted:
            if file in changed or file.again:
                file.again = False
                count += self._with_care(file, partial(self._take, file, since))
            if said := self._not_taken(file.growing):
                self._pass_over(file, FILE, said)
        for path in self._files.keys() - set(paths):
            if not path.exists():
                del self._files[path]
        return count

    def _with_care(self, file: _File, work: Callable[[], int]) -> int:
        """Do it; return 0 where the recording cannot be read, which is said, or is not there any more."""
        path = file.growing.path
        try:
            return work()
        except RecordingError as error:
            self._pass_over(file, FILE, left_out(path, "", str(error)))
        except FileNotFoundError:
            self._files.pop(path, None)  # recordings have a bound, and the oldest are deleted
        return 0

    def _read(self, file: _File) -> bool:
        """Read what is new of a recording and of the changes to it; return whether there was something."""
        growing = file.growing
        edits = edits_version(growing.path)
        if not growing.advance() and edits == file.edits:
            return False
        file.edits = edits
        file.episodes = apply_edits(growing.index.episodes, read_edits(growing.path)).episodes
        return True

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
        is_whole = not growing.index.episodes and self._wholes is not None and self._wholes.get(growing.path) == ""
        if not is_whole and not any(each.entry.state == "kept" for each in file.episodes):
            return 0
        with growing.reader() as reader:
            stretches = stretches_of(reader, file.episodes, self._options.task if is_whole else None)
            due = (each for each in stretches if self._is_due(each, since) and self._comes_in(file, each))
            return sum(self._append(reader, each, file) for each in due)

    def _is_due(self, stretch: Stretch, since: int) -> bool:
        """Return whether it ended late enough, or is kept of what was taken out."""
        notes = self._emptied if self._state is None else self._state.notes
        return stretch.ended >= since or _is_of(stretch, [] if notes is None else notes.taken_out)

    def _begin_anew(self, emptied: DatasetNotes | None) -> None:
        """Let the next dataset have the options of one that has no episode any more."""
        self._emptied, self._robot = emptied, None
        if emptied is not None:
            self._options = msgspec.structs.replace(
                self._options,
                tolerance=emptied.tolerance,
                fps=emptied.fps or None,
                cameras=[topic.removeprefix(CAMERA) for topic in emptied.topics],
                layout=emptied.layout,
                only=emptied.only,
            )

    def _take_out(self, discarded: Sequence[EventRange], files: Sequence[_File]) -> None:
        """Take what the dataset has of discarded episodes out of it, under whatever ids it has it."""
        self._discarded, self._owes_removal = discarded, False
        self._staying &= set(discarded)
        new = [each for each in discarded if each not in self._staying]
        if self._state is None or not new:
            return
        try:
            self._state, notes, taken = remove(self._root, self._state, new)
        except (RecordingError, OSError) as error:
            self._owes_removal = isinstance(error, OSError) and error.errno in FULL
            if not self._owes_removal:
                self._staying.update(new)
            what = "is tried again" if self._owes_removal else "stays"
            self._troubles.say(f"what {self._root.name} has of discarded episodes {what}: {error}")
            recover(self._root)
            self._state = read_state(self._root) if is_dataset(self._root) else None
            return
        if not taken:
            return
        self._troubles.end()
        if self._state is None:
            self._begin_anew(notes)
        names = ", ".join(each.episode or f"all of {each.recording}" for each in taken)
        left = len(notes.episodes)
        self._say(f"episode {names}: discarded since, and taken out of {self._root.name}, which has {left} left")
        changed = {(each.recording, each.epoch) for each in taken}
        for file in files:  # something that did not fit may fit now
            file.again = True
            if (file.growing.index.recording, file.growing.index.epoch) in changed:
                file.passed &= {FILE}

    def _comes_in(self, file: _File, stretch: Stretch) -> bool:
        """Return whether it is new and wanted; say once why not."""
        if _is_of(stretch, self._discarded):
            self._pass_over(file, _key(stretch), left_out(stretch.path, stretch.episode, DISCARDED))
            return False
        found = None if self._state is None else present(self._state.notes.episodes, stretch)
        if found is None:
            if why := why_not_wanted(stretch, self._options.only if self._state is None else self._state.notes.only):
                self._pass_over(file, _key(stretch, why), left_out(stretch.path, stretch.episode, why))
            return not why and _key(stretch) not in file.passed
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
                self._troubles.say(f"{self._root.name} cannot be written, and is tried again: {error}")
            if self._state is not None:
                recover(self._root)
                self._state = read_state(self._root)
            return False
        self._troubles.end()
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
        tolerance = self._options.most_behind if state is None else state.notes.tolerance
        fps = self._options.fps if state is None else state.fps if state.notes.has_rate else None
        (rows,) = rows_of(reader, layout, [stretch], topics, tolerance, fps)
        if not rows.frames:
            if state is not None:
                note_without_rows(self._root, state, rows)
            else:
                self._without_rows.append(rows)
            raise DatasetRefused(no_rows(tolerance))
        state = state or self._first_state(robot, layout, topics, rows)
        append(self._root, state, layout, [rows])
        self._state, self._robot = state, robot
        return rows

    def _first_state(
        self, robot: RobotDescription, layout: DatasetLayout, topics: list[str], rows: EpisodeRows
    ) -> DatasetState:
        state, before = new_state(robot, layout, topics, self._options, [rows], self._without_rows), self._emptied
        if before is not None:
            state.notes = msgspec.structs.replace(
                state.notes, version=3, batches=before.batches, gone=before.gone, taken_out=before.taken_out
            )
        return state

    def _pass_over(self, file: _File, key: Key, said: str) -> None:
        if key not in file.passed:
            file.passed.add(key)
            self.left_out += 1
            self._say(said)


def _age(path: Path) -> tuple[str, int]:
    """Return the order of files: their names begin with the time, and from the second part on end with its number."""
    name, _, part = path.stem.rpartition("-p")
    return (name, int(part)) if name and part.isdecimal() and part.isascii() else (path.stem, 1)


def _key(stretch: Stretch, not_wanted: str = "") -> Key:
    return stretch.episode, stretch.first_event, stretch.last_event, not_wanted


def _is_of(stretch: Stretch, ranges: Sequence[EventRange]) -> bool:
    """Return whether it has events of one of the ranges."""
    own = stretch.info.recording, stretch.info.epoch, stretch.first_event, stretch.last_event
    return any(each.shared(*own) for each in ranges)
