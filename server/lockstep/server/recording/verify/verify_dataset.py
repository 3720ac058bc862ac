"""Checks a LeRobot dataset that Lockstep has exported: `lockstep verify DIRECTORY`. Needs pyarrow."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import av
import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from lockstep.protocol.serial import event_gap, is_event
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.lerobot_meta import DatasetEpisode, DatasetNotes

__all__ = ["DatasetVerdict", "verify_dataset"]

DatasetCheckName = Literal[
    "aligned",  # no picture is stamped newer than its row's event, or older by more than the tolerance
    "within",  # each row, and the picture in it, is of the kept stretch that its episode is
    "ordered",  # the events of an episode go up, and no event is in two rows
    "counted",  # rows, episodes and the pictures in the videos are as many as the dataset says
]
CHECKS: tuple[DatasetCheckName, ...] = ("aligned", "within", "ordered", "counted")
_notes_decoder = msgspec.json.Decoder(DatasetNotes)
_info_decoder = msgspec.json.Decoder(dict[str, Any])
MOST = 50  # violations of a check that are listed
FILE = "chunk-000/file-000"


class DatasetViolation(msgspec.Struct, frozen=True):
    row: int  # its index; -1: of the dataset as a whole
    text: str


class DatasetCheck(msgspec.Struct):
    looked: int = 0  # number of cases that were checked
    count: int = 0  # of violations
    violations: list[DatasetViolation] = []  # the first ones

    @property
    def ok(self) -> bool:
        return self.count == 0

    def look(self, good: bool, row: int, text: str) -> None:
        self.looked += 1
        if not good:
            self.count += 1
            if len(self.violations) < MOST:
                self.violations.append(DatasetViolation(row, text))


class DatasetVerdict(msgspec.Struct, kw_only=True):
    ok: bool
    episodes: int
    rows: int
    tolerance: int
    checks: dict[DatasetCheckName, DatasetCheck]


def verify_dataset(root: Path) -> DatasetVerdict:
    """Check a dataset.

    Raises:
        RecordingDamaged: Lockstep has not exported it, or it cannot be read.
        OSError: a file is missing.
    """
    try:
        notes = _notes_decoder.decode((root / "meta" / "lockstep.json").read_bytes())
        info = _info_decoder.decode((root / "meta" / "info.json").read_bytes())
        rows = pq.read_table(root / "data" / f"{FILE}.parquet").to_pylist()
        places = pq.read_table(root / "meta" / "episodes" / f"{FILE}.parquet").to_pylist()
        checks: dict[DatasetCheckName, DatasetCheck] = {name: DatasetCheck() for name in CHECKS}
        _check_rows(checks, notes, rows)
        _check_counts(checks["counted"], root, notes, info, rows, places)
    except (msgspec.DecodeError, pa.ArrowException, KeyError, TypeError, IndexError, av.FFmpegError) as error:
        raise RecordingDamaged(f"{root.name}: {error}") from error
    ok = all(check.ok for check in checks.values())
    return DatasetVerdict(ok=ok, episodes=len(notes.episodes), rows=len(rows), tolerance=notes.tolerance, checks=checks)


def _check_rows(
    checks: Mapping[DatasetCheckName, DatasetCheck], notes: DatasetNotes, rows: list[dict[str, Any]]
) -> None:
    seen: set[tuple[str, int]] = set()
    before: tuple[int, int] | None = None  # episode and event of the row before
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
        goes_up = before is None or before[0] != index or event_gap(event, before[1]) > 0
        is_new = (episode.epoch, event) not in seen
        checks["ordered"].look(goes_up and is_new, number, f"event {event} again, or out of order")
        seen.add((episode.epoch, event))
        before = index, event


def _stamps(row: dict[str, Any], notes: DatasetNotes) -> list[int]:
    if not notes.cameras:
        return []
    found = row["lockstep.stamp"]
    return [found] if isinstance(found, int) else list(found)


def _is_in(event: int, episode: DatasetEpisode) -> bool:
    if not is_event(event):
        return False
    return event_gap(event, episode.first_event) >= 0 and event_gap(episode.last_event, event) >= 0


def _check_counts(
    check: DatasetCheck,
    root: Path,
    notes: DatasetNotes,
    info: dict[str, Any],
    rows: list[dict[str, Any]],
    places: list[dict[str, Any]],
) -> None:
    check.look(info["total_frames"] == len(rows), -1, f"{info['total_frames']} rows are said, {len(rows)} are there")
    check.look(len(places) == len(notes.episodes) == info["total_episodes"], -1, "the number of episodes differs")
    for index, (place, episode) in enumerate(zip(places, notes.episodes, strict=False)):
        mine = sum(1 for row in rows if row["episode_index"] == index)
        fits = place["length"] == mine == episode.rows
        check.look(fits, -1, f"episode {index} has {mine} rows, {place['length']} are said")
    for camera in notes.cameras:
        with av.open(str(root / "videos" / camera / f"{FILE}.mp4")) as video:
            count = sum(1 for packet in video.demux(video=0) if packet.size)
        check.look(count == len(rows), -1, f"{camera} has {count} pictures for {len(rows)} rows")
