"""Checks a LeRobot dataset that Lockstep has exported: `lockstep verify DIRECTORY`. Needs pyarrow."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import av
import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from lockstep.protocol.serial import event_gap, is_event
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.server.recording.dataset.commit import is_interrupted
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.lerobot_meta import DatasetEpisode, DatasetNotes
from lockstep.server.recording.export.lerobot_sampling import LONGEST
from lockstep.server.recording.verify.verify_origins import outdated, recorded_now

__all__ = ["DatasetCheck", "DatasetVerdict", "verify_dataset"]

DatasetCheckName = Literal[
    "aligned",  # no picture is stamped newer than its row's event, or older by more than the tolerance
    "within",  # each row, and the picture in it, is of the kept stretch that its episode is
    "ordered",  # the events of an episode go up, and none is in two rows but where it stood longer than a row
    "timed",  # the rows of an episode are as far apart as the dataset says
    "counted",  # rows, episodes and the pictures in the videos are as many as the dataset says, and no append is open
    "current",  # each episode is kept in its recording, as the dataset has it; with `recordings` alone
    "shown",  # the event that is drawn into a picture is the one that the dataset says; with `pixels` alone
]
CHECKS: tuple[DatasetCheckName, ...] = ("aligned", "within", "ordered", "timed", "counted", "current", "shown")
_notes_decoder = msgspec.json.Decoder(DatasetNotes)
_info_decoder = msgspec.json.Decoder(dict[str, Any])
MOST = 50  # violations of a check that are listed; of `current` all are, since each episode is to be named
STEP = 0.01  # of an interval, by which the moment of a row may be wrong
READABLE = 0.5  # of the pictures of a camera show an event: then all of them have to


class DatasetViolation(msgspec.Struct, frozen=True):
    row: int  # its index; -1: of the dataset as a whole
    text: str


class DatasetCheck(msgspec.Struct):
    looked: int = 0  # number of cases that were checked
    count: int = 0  # of violations
    violations: list[DatasetViolation] = []  # the first ones; of `current` all

    @property
    def ok(self) -> bool:
        return self.count == 0

    def look(self, good: bool, row: int, text: str, most: int | None = MOST) -> None:
        """Count a case. `most`: violations that are listed; None: all."""
        self.looked += 1
        if not good:
            self.count += 1
            if most is None or len(self.violations) < most:
                self.violations.append(DatasetViolation(row, text))


class DatasetVerdict(msgspec.Struct, kw_only=True):
    ok: bool
    episodes: int
    rows: int
    tolerance: int
    checks: dict[DatasetCheckName, DatasetCheck]


def verify_dataset(root: Path, *, pixels: bool = False, recordings: Path | None = None) -> DatasetVerdict:
    """Check a dataset.

    Args:
        pixels: also decode all pictures and read the events in them, where the robot has drawn some (--event-strip)
        recordings: a folder with the recordings that it was made of; None: they are not looked at

    Raises:
        RecordingDamaged: Lockstep has not exported it, or it cannot be read.
        OSError: a file or the folder is missing.
    """
    try:
        notes = _notes_decoder.decode((root / "meta" / "lockstep.json").read_bytes())
        info = _info_decoder.decode((root / "meta" / "info.json").read_bytes())
        parts = [_table(root / "data" / f"{file}.parquet") for file in notes.files]
        rows = [row for part in parts for row in part]
        places = [place for file in notes.files for place in _table(root / "meta" / "episodes" / f"{file}.parquet")]
        checks: dict[DatasetCheckName, DatasetCheck] = {name: DatasetCheck() for name in CHECKS}
        _check_rows(checks, notes, info["fps"], rows)
        _check_counts(checks["counted"], root, notes, info, rows, places)
        _check_files(checks["counted"], root, notes)
        for file, part in zip(notes.files, parts, strict=True):
            for place, camera in enumerate(notes.cameras):
                video = root / "videos" / camera / f"{file}.mp4"
                _check_video(
                    checks, camera, video, [(row["index"], _stamps(row, notes)[place]) for row in part], pixels
                )
        if recordings is not None:
            recorded = recorded_now(recordings, notes.episodes)
            for each in notes.episodes:
                differs = outdated(each, recorded)
                checks["current"].look(not differs, -1, differs, most=None)
    except (msgspec.DecodeError, pa.ArrowException, KeyError, TypeError, IndexError, av.FFmpegError) as error:
        raise RecordingDamaged(f"{root.name}: {error}") from error
    ok = all(check.ok for check in checks.values())
    return DatasetVerdict(ok=ok, episodes=len(notes.episodes), rows=len(rows), tolerance=notes.tolerance, checks=checks)


def _table(path: Path) -> list[dict[str, Any]]:
    return pq.read_table(path).to_pylist()  # type: ignore[no-any-return]


def _check_rows(
    checks: Mapping[DatasetCheckName, DatasetCheck], notes: DatasetNotes, fps: int, rows: list[dict[str, Any]]
) -> None:
    seen: set[tuple[str, int]] = set()
    before: dict[str, Any] | None = None
    for number, row in enumerate(rows):
        event, index = row["lockstep.event"], row["episode_index"]
        episode = notes.episodes[index]
        stamps = _stamps(row, notes)
        checks["counted"].look(len(stamps) == len(notes.cameras), number, f"{len(stamps)} stamps")
        for camera, stamp in zip(notes.cameras, stamps, strict=False):
            gap = event_gap(event, stamp) if is_event(stamp) else -1
            good = 0 <= gap <= notes.tolerance
            checks["aligned"].look(good, number, f"{camera} shows event {stamp}, the row is event {event}")
            checks["within"].look(_is_in(stamp, episode), number, f"{camera} shows event {stamp}, of another stretch")
        checks["within"].look(_is_in(event, episode), number, f"event {event} is not of its episode")
        before = before if before is not None and before["episode_index"] == index else None
        again = notes.has_rate and before is not None and before["lockstep.event"] == event
        goes_up = before is None or event_gap(event, before["lockstep.event"]) > 0
        good = again or (goes_up and (episode.epoch, event) not in seen)
        checks["ordered"].look(good, number, f"event {event} again, or out of order")
        if "lockstep.time" in row:
            checks["timed"].look(_is_timed(notes, fps, before, row), number, f"{row['lockstep.time']:.3f} s is off")
        seen.add((episode.epoch, event))
        before = row


def _is_timed(notes: DatasetNotes, fps: int, before: dict[str, Any] | None, row: dict[str, Any]) -> bool:
    """Return whether the row is a whole number of intervals after the row before; without a rate, not before it."""
    moment, frame = row["lockstep.time"] + row["lockstep.age"], row["frame_index"]
    if abs(row["timestamp"] * fps - frame) > STEP or not 0 <= row["lockstep.age"] <= LONGEST:
        return False
    if before is None:
        return bool(frame == 0 and moment == 0)
    since = moment - before["lockstep.time"] - before["lockstep.age"]
    if not notes.has_rate:
        return bool(frame == before["frame_index"] + 1 and row["lockstep.age"] == 0 and since >= 0)
    steps = round(since * fps)
    return bool(frame == before["frame_index"] + 1 and steps >= 1 and abs(since * fps - steps) < STEP)


def _check_video(
    checks: Mapping[DatasetCheckName, DatasetCheck],
    camera: str,
    path: Path,
    stamps: list[tuple[int, int]],
    pixels: bool,
) -> None:
    """Count the pictures of a file; with `pixels`, read the events that are drawn into them."""
    with av.open(str(path)) as video:
        if not pixels:
            count = sum(1 for packet in video.demux(video=0) if packet.size)
        else:
            events = list(_drawn(video))
            count = len(events)
            read = sum(event is not None for event in events)
            for (row, stamp), event in zip(stamps, events, strict=False):
                if read > READABLE * count:
                    checks["shown"].look(event == stamp, row, f"{camera} shows event {event}, {stamp} is said")
    checks["counted"].look(count == len(stamps), -1, f"{camera} has {count} pictures for {len(stamps)} rows")


def _drawn(video: Any) -> Iterator[int | None]:
    for frame in video.decode(video=0):
        yield read_event_strip(frame.reformat(format="gray").to_ndarray())


def _stamps(row: dict[str, Any], notes: DatasetNotes) -> list[int]:
    if not notes.cameras:
        return []
    found = row["lockstep.stamp"]
    return [found] if isinstance(found, int) else list(found)


def _is_in(event: int, episode: DatasetEpisode) -> bool:
    if not is_event(event):
        return False
    return event_gap(event, episode.first_event) >= 0 and event_gap(episode.last_event, event) >= 0


def _check_files(check: DatasetCheck, root: Path, notes: DatasetNotes) -> None:
    """Look for files that the dataset does not say: LeRobot reads all that it finds."""
    said = set(notes.files)
    videos = [(f"videos/{camera}", "mp4") for camera in notes.cameras]
    for kind, ending in (("data", "parquet"), ("meta/episodes", "parquet"), *videos):
        for path in (root / kind).glob(f"*/*.{ending}"):
            name = path.relative_to(root / kind).with_suffix("").as_posix()
            check.look(name in said, -1, f"{path.relative_to(root)} is no file of the dataset's")


def _check_counts(
    check: DatasetCheck,
    root: Path,
    notes: DatasetNotes,
    info: dict[str, Any],
    rows: list[dict[str, Any]],
    places: list[dict[str, Any]],
) -> None:
    check.look(
        not is_interrupted(root), -1, "an append was interrupted: the next `lockstep export --append` completes it"
    )
    check.look(info["total_frames"] == len(rows), -1, f"{info['total_frames']} rows are said, {len(rows)} are there")
    check.look(len(places) == len(notes.episodes) == info["total_episodes"], -1, "the number of episodes differs")
    for index, (place, episode) in enumerate(zip(places, notes.episodes, strict=False)):
        mine = sum(1 for row in rows if row["episode_index"] == index)
        fits = place["length"] == mine == episode.rows
        check.look(fits, -1, f"episode {index} has {mine} rows, {place['length']} are said")
