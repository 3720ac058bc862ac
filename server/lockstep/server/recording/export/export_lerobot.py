"""`lockstep export --to lerobot`: a LeRobot dataset, version 3. Needs pyarrow.

The kept episodes of one or several recordings are its episodes; a recording that was not made by episodes is one as a
whole (`whole_recordings`). `lerobot_rows` says what a row is, `lerobot_layout` what is in it.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.episodes.episode_filter import EpisodeFilter
from lockstep.server.recording.errors import DatasetRefused, RecordingDamaged
from lockstep.server.recording.export.lerobot_batch import DatasetState, noted, noted_without_rows, write_batch
from lockstep.server.recording.export.lerobot_layout import DatasetLayout, LayoutChoice, layout_of
from lockstep.server.recording.export.lerobot_meta import EVENTS, RATE, DatasetNotes
from lockstep.server.recording.export.lerobot_present import present
from lockstep.server.recording.export.lerobot_rows import (
    EpisodeRows,
    Stretch,
    check_same_robot,
    episodes_now,
    rows_of,
    stretches_of,
)
from lockstep.server.recording.export.lerobot_video import camera_key
from lockstep.server.recording.export.unfinished import unfinished
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.whole_recordings import whole_recordings

__all__ = [
    "TOLERANCE",
    "DatasetOptions",
    "Say",
    "as_a_whole",
    "cameras_of",
    "export",
    "export_all",
    "left_out",
    "new_state",
    "why_not_wanted",
    "no_rows",
    "not_as_a_whole",
    "options_of",
]

Say = Callable[[str], None]

TOLERANCE = 4  # events, as the page's own


class DatasetOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What is chosen for a dataset."""

    task: str = ""  # of recordings without episodes, in words
    whole: bool = False  # each file without episodes is one as a whole, also where that is not certain
    tolerance: int | None = None  # events by which a picture may be older than its row; None: `TOLERANCE`
    fps: int | None = None  # Hz, of the rows; None: each event is a row
    cameras: list[str] = []  # names; empty: all that the first recording has pictures of
    layout: LayoutChoice = LayoutChoice()
    only: EpisodeFilter = EpisodeFilter()  # which of the kept episodes

    @property
    def most_behind(self) -> int:
        """The tolerance: events by which a picture may be older than its row."""
        return TOLERANCE if self.tolerance is None else self.tolerance


def export(path: Path, out: Path | None, task: str) -> list[Path]:
    """Write and return a new directory: `out`, or one beside `path`. Raises RecordingError, OSError."""
    return export_all([path], out, task)


def options_of(chosen: Mapping[str, Any]) -> DatasetOptions:
    """Return the options that have these values."""
    return msgspec.convert(chosen, DatasetOptions)


def export_all(
    paths: Sequence[Path],
    out: Path | None,
    options: DatasetOptions | str = "",
    tolerance: int | None = None,
    say: Say = lambda text: None,
) -> list[Path]:
    """Write one dataset of the recordings, in their order. The directory appears when all of it is written.

    Args:
        out: a new directory; None: one beside the first recording
        options: or the task alone
        tolerance: instead of that in the options
        say: is told each kept episode that is not wanted, has no row, or whose events another file has given already,
            and of each file without episodes what becomes of it

    Raises:
        RecordingError: a recording cannot be read, none has a row, they are of different robots, or the options do not
            fit the robot.
        OSError: the directory is there already, or cannot be written.
    """
    root = out or paths[0].with_suffix(".lerobot")
    if root.exists():
        raise FileExistsError(17, "it is there already", str(root))
    chosen = options if isinstance(options, DatasetOptions) else DatasetOptions(task=options)
    if tolerance is not None:
        chosen = msgspec.structs.replace(chosen, tolerance=tolerance)
    description, layout, topics, read = _read(paths, chosen, say)
    without = [each for each in read if not each.frames]
    for each in without:
        say(left_out(each.stretch.path, each.stretch.episode, no_rows(chosen.most_behind)))
    if len(without) == len(read):
        raise RecordingDamaged(f"no kept episode has a row: {no_rows(chosen.most_behind)}")
    episodes = [each for each in read if each.frames]
    state = new_state(description, layout, topics, chosen, episodes, without)
    with unfinished(root) as partial:
        write_batch(partial, state, layout, episodes)
    return [root]


def new_state(
    description: RobotDescription,
    layout: DatasetLayout,
    topics: list[str],
    options: DatasetOptions,
    episodes: Sequence[EpisodeRows],
    without_rows: Sequence[EpisodeRows] = (),
) -> DatasetState:
    """Return the state of a dataset that has nothing yet. Without a rate of its own it has that of these episodes."""
    notes = DatasetNotes(
        tolerance=options.most_behind,
        has_rate=options.fps is not None,
        sampling=EVENTS if options.fps is None else RATE,
        cameras=[camera_key(topic) for topic in topics],
        topics=topics,
        units=layout.units,
        layout=layout.choice,
        only=options.only,
        episodes=[],
    )
    notes = noted_without_rows(notes, without_rows)
    return DatasetState(robot=description.name, fps=options.fps or _rate(episodes), notes=notes)


def no_rows(tolerance: int) -> str:
    """Return why an episode has no row."""
    return (
        "no event has a feedback, a command that answers it, and a picture of every camera "
        f"that is at most {tolerance} events older"
    )


def why_not_wanted(stretch: Stretch, only: EpisodeFilter) -> str:
    """Return in words why a stretch is not wanted; "" if it is."""
    if only and not stretch.episode:
        return "it has no episodes to choose from"
    return only.why_not(stretch)


def left_out(path: Path, episode: str, why: str) -> str:
    """Return in words that an episode, or "" for the recording as a whole, is in no dataset."""
    return f"{f'episode {episode} of ' if episode else ''}{path.name} is left out: {why}"


def as_a_whole(path: Path, task: str) -> str:
    """Return in words that a recording is one episode."""
    return f"{path.name} has no episodes and is one as a whole, with the task {task!r}"


def not_as_a_whole(path: Path, why: str) -> str:
    """Return in words that a recording without episodes is in no dataset, and how it gets into one."""
    return left_out(path, "", f"it has no episodes, and {why}; --whole takes it as one episode all the same")


def cameras_of(reader: RecordingReader, names: Sequence[str]) -> list[str]:
    """Return the topics of these cameras; without names, of all that have pictures. Raises DatasetRefused."""
    found = [each.topic for each in reader.index.topics if reader.index.keyframes.get(each.topic)]
    missing = [name for name in names if CAMERA + name not in found]
    if missing:
        raise DatasetRefused(f"{reader.path.name} has no pictures of {', '.join(missing)}")
    return [CAMERA + name for name in names] or found


def _read(
    paths: Sequence[Path], options: DatasetOptions, say: Say
) -> tuple[RobotDescription, DatasetLayout, list[str], list[EpisodeRows]]:
    """Return the robot, its cameras' topics, and the rows of all kept episodes, which may have none."""
    wholes = whole_recordings(paths, wanted=options.whole)
    left: list[str] = []
    description: RobotDescription | None = None
    layout: DatasetLayout | None = None
    cameras: list[str] = []
    episodes: list[EpisodeRows] = []
    for path in paths:
        with RecordingReader(path) as reader:
            now = episodes_now(reader)
            if not now and (why := wholes[path]):
                left.append(not_as_a_whole(path, why))
                say(left[-1])
                continue
            robot, topics = reader.description(), cameras_of(reader, options.cameras)
            if description is None or layout is None:
                description, cameras, layout = robot, topics, layout_of(robot, options.layout)
            check_same_robot(description, robot)
            if sorted(topics) != sorted(cameras):
                raise RecordingDamaged(f"{path.name} has other cameras than {paths[0].name}")
            for stretch in stretches_of(reader, now, options.task):
                if why := why_not_wanted(stretch, options.only):
                    say(left_out(path, stretch.episode, why))
                    continue
                if found := present([noted(each) for each in episodes if each.frames], stretch):
                    say(left_out(path, stretch.episode, found.in_words()))
                    continue
                if not stretch.episode:
                    say(as_a_whole(path, stretch.task))
                episodes += rows_of(reader, layout, [stretch], cameras, options.most_behind, options.fps)
    if description is None or layout is None or not episodes:
        none = "there is no kept episode" + (" that is wanted" if options.only else "")
        raise RecordingDamaged("; ".join([none, *left]))
    return description, layout, cameras, episodes


def _rate(episodes: Sequence[EpisodeRows]) -> int:
    """Return the median rate of the episodes; a dataset of this version has one for all, in whole hertz, 1 at least."""
    rates = [each.rate for each in episodes if each.rate > 0]
    return max(1, round(float(np.median(rates)))) if rates else 1
