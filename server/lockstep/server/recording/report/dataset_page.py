"""The report of a LeRobot dataset that Lockstep has exported, as one HTML page. Needs pyarrow."""

from collections import defaultdict
from pathlib import Path
from typing import Any

import av
import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from lockstep.protocol.serial import event_gap, is_event
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.lerobot_meta import DatasetNotes
from lockstep.server.recording.reading.picture_at import jpeg_of
from lockstep.server.recording.report import page_parts as parts
from lockstep.server.recording.verify.verify_dataset import DatasetVerdict, verify_dataset

__all__ = ["dataset_page"]

MAX_EPISODES = 1000
MAX_SHOWN = 12  # rows that are shown with their pictures
MAX_DECODED = 20_000  # pictures of a camera
WIDTH = 320  # pixels

Row = dict[str, Any]
_notes = msgspec.json.Decoder(DatasetNotes)
_info = msgspec.json.Decoder(dict[str, Any])


def dataset_page(root: Path) -> str:
    """Return the page of a dataset.

    Raises:
        RecordingDamaged: Lockstep has not exported it, or it cannot be read.
        OSError: a file is missing.
    """
    verdict = verify_dataset(root)
    try:
        notes = _notes.decode((root / "meta" / "lockstep.json").read_bytes())
        info = _info.decode((root / "meta" / "info.json").read_bytes())
        rows = _rows(root)
        widest = _widest(rows, notes)
        pictures = {camera: _pictures(root, camera, {row["index"] for row in widest}) for camera in notes.cameras}
    except (msgspec.DecodeError, pa.ArrowException, KeyError, TypeError, IndexError, av.FFmpegError) as error:
        raise RecordingDamaged(f"{root.name}: {error}") from error
    fps = info.get("fps")
    lead = (
        f"{info.get('robot_type', '')}, {verdict.episodes} episodes, {verdict.rows} rows, {fps} rows a second, "
        f"tolerance {verdict.tolerance} events."
    )
    sections = [
        parts.section("checks", "Checks", _checks(verdict)),
        parts.section("tasks", "Tasks", _tasks(notes)),
        parts.section("drivers", "Drivers", _drivers(rows, notes)),
        parts.section("cameras", "Cameras", _cameras(rows, notes)),
        parts.section("episodes", "Episodes", _episodes(notes, fps)),
        parts.section("widest", "The rows with the largest gaps", _shown(widest, notes, pictures)),
    ]
    return parts.page(root.name, lead, sections)


def _rows(root: Path) -> list[Row]:
    wanted = ("index", "episode_index", "lockstep.event", "lockstep.stamp", "lockstep.gap", "lockstep.driver")
    found: list[Row] = []
    for file in sorted((root / "data").glob("*/*.parquet")):
        with pq.ParquetFile(file) as table:
            columns = [name for name in wanted if name in table.schema_arrow.names]
            found += table.read(columns).to_pylist()
    return found


def _stamps(row: Row) -> list[int]:
    found = row.get("lockstep.stamp", [])
    return [found] if isinstance(found, int) else list(found)


def _checks(verdict: DatasetVerdict) -> str:
    rows = [
        (name, check.looked, "kept" if check.ok else f"{check.count} times not: {check.violations[0].text}")
        for name, check in verdict.checks.items()
    ]
    return parts.table(("Check", "Looked at", "Result"), rows)


def _tasks(notes: DatasetNotes) -> str:
    found: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0, 0])
    for each in notes.episodes:
        counts = found[each.task]
        counts[0] += 1
        counts[1] += each.outcome == "success"
        counts[2] += each.outcome == "failure"
        counts[3] += each.rows
        counts[4] += each.left_out
    rows: list[tuple[parts.Cell, ...]] = [
        (task, *counts, parts.share(counts[1], counts[1] + counts[2])) for task, counts in found.items()
    ]
    head = ("Task", "Episodes", "Success", "Failure", "Rows", "Rows left out", "Success of those that say")
    return parts.table(head, rows)


def _drivers(rows: list[Row], notes: DatasetNotes) -> str:
    """Who drove each row; a change of the driver within an episode is an intervention."""
    counts: dict[int, int] = defaultdict(int)
    episodes: dict[int, set[int]] = defaultdict(set)
    taken: dict[int, int] = defaultdict(int)
    before: tuple[int, int] | None = None
    for row in rows:
        driver, episode = row["lockstep.driver"], row["episode_index"]
        counts[driver] += 1
        episodes[driver].add(episode)
        if before is not None and before[0] == episode and before[1] != driver:
            taken[driver] += 1
        before = episode, driver
    table = []
    for driver, count in sorted(counts.items()):
        outcomes = [notes.episodes[each].outcome for each in episodes[driver]]
        success, failure = outcomes.count("success"), outcomes.count("failure")
        name = notes.drivers[driver] or "nobody"
        table.append(
            (name, count, len(outcomes), taken[driver], success, failure, parts.share(success, success + failure))
        )
    head = ("Driver", "Rows", "Episodes", "Interventions", "Success", "Failure", "Success of those that say")
    return parts.table(head, table, "An intervention: another person drives from this row of an episode on.")


def _cameras(rows: list[Row], notes: DatasetNotes) -> str:
    table: list[tuple[parts.Cell, ...]] = []
    for at, camera in enumerate(notes.cameras):
        stamps = [(row["lockstep.event"], _stamps(row)[at]) for row in rows if len(_stamps(row)) > at]
        gaps = sorted(event_gap(event, stamp) for event, stamp in stamps if is_event(stamp))
        if not gaps:
            table.append((camera, 0, None, None, None))
            continue
        repeated = sum(one[1] == other[1] for one, other in zip(stamps, stamps[1:], strict=False))
        exact = parts.share(sum(gap == 0 for gap in gaps), len(gaps))
        table.append((camera, len(gaps), exact, gaps[-1], repeated))
    head = ("Camera", "Rows", "Of their own event", "Largest gap, events", "Same picture as the row before")
    return parts.table(head, table)


def _episodes(notes: DatasetNotes, fps: object) -> str:
    rate = fps if isinstance(fps, int | float) and fps else None
    rows = [
        (
            f"{at} {each.task}",
            each.outcome,
            f"{each.recording} part {each.part}",
            f"{each.first_event} – {each.last_event}",
            each.rows,
            each.left_out,
            parts.number(each.rows / rate if rate else None),
        )
        for at, each in enumerate(notes.episodes[:MAX_EPISODES])
    ]
    head = ("Episode", "Outcome", "Recording", "Events", "Rows", "Left out", "Length, s")
    words = "Left out: events without a picture within the tolerance, or whose action is not known."
    return parts.table(head, rows, words, left=3)


def _widest(rows: list[Row], notes: DatasetNotes) -> list[Row]:
    """Return the rows with the largest gaps, one of each episode."""
    best: dict[int, Row] = {}
    for row in rows:
        gap = row.get("lockstep.gap", 0)
        known = best.get(row["episode_index"])
        if gap and (known is None or gap > known["lockstep.gap"]):
            best[row["episode_index"]] = row
    return sorted(best.values(), key=lambda row: -int(row["lockstep.gap"]))[:MAX_SHOWN]


def _pictures(root: Path, camera: str, wanted: set[int]) -> dict[int, bytes]:
    """Return the pictures of these rows as JPEG, as far as they are within the first ones."""
    found: dict[int, bytes] = {}
    at = 0
    for file in sorted((root / "videos" / camera).glob("*/*.mp4")):
        with av.open(str(file)) as video:
            for frame in video.decode(video=0):
                if len(found) == len(wanted) or at >= MAX_DECODED:
                    return found
                if at in wanted:
                    found[at] = jpeg_of(frame, WIDTH)
                at += 1
    return found


def _shown(widest: list[Row], notes: DatasetNotes, pictures: dict[str, dict[int, bytes]]) -> str:
    if not widest:
        return "<p>Every picture is of its own row’s event.</p>"
    shown = []
    for row in widest:
        event, index, episode = row["lockstep.event"], row["index"], row["episode_index"]
        stills = []
        for at, camera in enumerate(notes.cameras):
            jpeg = pictures.get(camera, {}).get(index)
            if jpeg is not None:
                words = f"{camera}, stamped {_stamps(row)[at]}"
                stills.append(
                    f"<figure>{parts.picture(jpeg, words)}<figcaption>{parts.text(words)}</figcaption></figure>"
                )
        title = f"gap of {row['lockstep.gap']}: event {event}, row {index}, episode {episode}"
        shown.append(f"<li><h3>{parts.text(title)}</h3><div class='stills'>{''.join(stills)}</div></li>")
    return f"<ol class='moments'>{''.join(shown)}</ol>"
