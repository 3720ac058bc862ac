"""The report of a LeRobot dataset that Lockstep has exported, as one HTML page. Needs pyarrow."""

from collections import Counter, defaultdict
from collections.abc import Mapping
from functools import partial
from itertools import accumulate, groupby, pairwise
from pathlib import Path
from typing import Any, cast, get_args

import av
import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.protocol.serial import event_gap, is_event
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.lerobot_meta import DatasetNotes
from lockstep.server.recording.format.records import FeedbackRecord
from lockstep.server.recording.reading.picture_at import jpeg_of
from lockstep.server.recording.report import page_parts as parts
from lockstep.server.recording.report.dataset_figures import (
    Driver,
    Rate,
    Row,
    commands_by_driver,
    driver_of,
    event_rates,
    picture_rate,
)
from lockstep.server.recording.report.driver_figures import LONGEST, DriverTally
from lockstep.server.recording.report.policies import policies_section
from lockstep.server.recording.verify.verify_dataset import DatasetCheck, DatasetVerdict, verify_dataset

__all__ = ["dataset_page"]

MAX_EPISODES = 1000
MAX_SHOWN = 12  # rows that are shown with their pictures
MAX_DECODED = 20_000  # pictures of a camera
WIDTH = 320  # pixels

COLUMNS = ("index", "episode_index", "timestamp", "lockstep.event", "lockstep.stamp", "lockstep.gap", "lockstep.time")
DRIVEN = ("lockstep.age", "lockstep.driver", "lockstep.driver_kind", "lockstep.intervention")
OUTCOMES = get_args(EpisodeOutcome)

DRIVERS = (
    "Episodes and their outcomes: those in which they drove, also for a part. Events a second: of the time in which "
    f"they drove, {LONGEST:.0f} s of a pause at most. Command to feedback is measured at the console, in two digits."
)
CAMERAS = (
    "New pictures: rows whose picture is of another event than that of the row before, in the time of the rows, "
    f"{LONGEST:.0f} s of a pause at most."
)

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
        batches = {file: _rows(root, file, notes) for file in notes.files}
        rows = [row for batch in batches.values() for row in batch]
        tally = _tally(rows, notes)
        widest = _widest(rows)
        wanted, sizes = {row["index"] for row in widest}, {file: len(batch) for file, batch in batches.items()}
        pictures = {camera: _pictures(root, camera, wanted, sizes) for camera in notes.cameras}
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
        parts.section("drivers", "Drivers", _drivers(rows, notes, tally)),
        policies_section(tally),
        parts.section("cameras", "Cameras", _cameras(rows, notes)),
        parts.section("episodes", "Episodes", _episodes(rows, notes)),
        _without_rows(notes),
        parts.section("widest", "The rows with the largest gaps", _shown(widest, notes, pictures)),
    ]
    return parts.page(root.name, lead, sections)


def _rows(root: Path, file: str, notes: DatasetNotes) -> list[Row]:
    with pq.ParquetFile(root / "data" / f"{file}.parquet") as table:
        columns = [name for name in (*COLUMNS, *DRIVEN) if name in table.schema_arrow.names]
        found: list[Row] = table.read(columns).to_pylist()
    for row in found:
        row.setdefault("lockstep.time", row["timestamp"])
        if isinstance(row["lockstep.driver"], int):  # of the first version: a place in the notes
            row["lockstep.driver"] = notes.drivers[row["lockstep.driver"]]
        row["lockstep.driver"] = str(row["lockstep.driver"])
        row.setdefault("lockstep.driver_kind", "human")
    return found


def _stamps(row: Row) -> list[int]:
    found = row.get("lockstep.stamp", [])
    return [found] if isinstance(found, int) else list(found)


def _stamp(at: int, row: Row) -> int:
    return _stamps(row)[at]


def _result(check: DatasetCheck) -> str:
    if not check.ok:
        return f"{check.count} times not: {check.violations[0].text}"
    return "kept" if check.looked else "not looked at"


def _checks(verdict: DatasetVerdict) -> str:
    rows = [(name, check.looked or None, _result(check)) for name, check in verdict.checks.items()]
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


def _tally(rows: list[Row], notes: DatasetNotes) -> DriverTally:
    """Return who drove, from the rows, as a report of the recordings would say it of their events."""
    tally = DriverTally()
    for index, mine in groupby(rows, lambda row: int(row["episode_index"])):
        episode = notes.episodes[index]
        for row in mine:
            tally.take(_driven(row, str(index)))  # no time passes from one episode of a dataset to the next
        tally.take_episode(cast(EpisodeOutcome, episode.outcome) if episode.outcome in OUTCOMES else "")
    return tally


def _driven(row: Row, epoch: str) -> FeedbackRecord:
    return FeedbackRecord(
        epoch=epoch,
        event=row["lockstep.event"],
        issue=1,
        time=row["lockstep.time"],
        axes=[],
        driver=row["lockstep.driver"],
        driver_kind=row["lockstep.driver_kind"],
        intervention=bool(row.get("lockstep.intervention")),
    )


def _drivers(rows: list[Row], notes: DatasetNotes, tally: DriverTally) -> str:
    counts = Counter(driver_of(row) for row in rows)
    driven = {(row["episode_index"], driver_of(row)) for row in rows}
    episodes: dict[Driver, list[int]] = defaultdict(list)
    for index, driver in driven:
        episodes[driver].append(index)
    rates = event_rates(rows, driver_of)
    commands = commands_by_driver(notes.episodes, driven)
    table: list[tuple[parts.Cell, ...]] = []
    for name, kind in sorted({*counts, *commands}):
        driver = name, kind
        outcomes = [notes.episodes[each].outcome for each in episodes[driver]]
        success, failure = outcomes.count("success"), outcomes.count("failure")
        drove = tally.drivers.get(driver)
        interventions = None if drove is None else drove.interventions
        shared = parts.share(success, success + failure)
        own = (name or "nobody", kind, counts[driver], len(outcomes), interventions, success, failure, shared)
        known = commands.get(driver)
        delays = (None, None) if known is None else (known.delay(0.5), known.delay(0.95))
        refused = _refused(None if known is None else known.refused)
        table.append((*own, _hertz(rates.get(driver)), *map(parts.number, delays), refused))
    head = ("Driver", "Kind", "Rows", "Episodes", "Interventions", "Success", "Failure", "Success of those that say")
    more = ("Events a second", "Command → feedback, ms", "95 %", "Refused commands")
    return parts.table((*head, *more), table, f"{DRIVERS} {_known(notes)}".strip(), left=2)


def _known(notes: DatasetNotes) -> str:
    """Return in words of which episodes delays and refusals are known, unless of all."""
    known = sum(each.commands is not None for each in notes.episodes)
    if known == len(notes.episodes):
        return ""
    return f"Delays and refused commands are known of {known} of {len(notes.episodes)} episodes."


def _hertz(rate: Rate | None) -> str:
    return parts.number(None if rate is None else rate.hertz)


def _refused(counts: Mapping[str, int] | None) -> str:
    """Return the number of refused commands by reason; None: not known."""
    if counts is None:
        return "–"
    return ", ".join(f"{reason} {count}" for reason, count in sorted(counts.items())) or "0"


def _cameras(rows: list[Row], notes: DatasetNotes) -> str:
    table: list[tuple[parts.Cell, ...]] = []
    for at, camera in enumerate(notes.cameras):
        mine = [row for row in rows if len(_stamps(row)) > at]
        stamps = [(row["episode_index"], row["lockstep.event"], _stamps(row)[at]) for row in mine]
        gaps = sorted(event_gap(event, stamp) for _, event, stamp in stamps if is_event(stamp))
        if not gaps:
            table.append((camera, 0, None, None, None, None))
            continue
        repeated = sum(one[::2] == other[::2] for one, other in pairwise(stamps))
        exact = parts.share(sum(gap == 0 for gap in gaps), len(gaps))
        rate = picture_rate(mine, partial(_stamp, at))
        table.append((camera, len(gaps), exact, gaps[-1], repeated, _hertz(rate)))
    head = ("Camera", "Rows", "Of their own event", "Largest gap, events", "Same picture as the row before")
    return parts.table((*head, "New pictures a second"), table, CAMERAS)


def _episodes(rows: list[Row], notes: DatasetNotes) -> str:
    lengths: dict[int, float] = defaultdict(float)
    for row in rows:
        at = row["lockstep.time"] + row.get("lockstep.age", 0.0)
        lengths[row["episode_index"]] = max(lengths[row["episode_index"]], at)
    rates = event_rates(rows, lambda row: int(row["episode_index"]))
    table: list[tuple[parts.Cell, ...]] = []
    for at, each in enumerate(notes.episodes[:MAX_EPISODES]):
        origin = f"{each.recording} part {each.part}", f"{each.first_event} – {each.last_event}"
        known = each.commands
        delays = (None, None) if known is None else (known.median_ms, known.p95_ms)
        refused = _refused(None if known is None else known.refused)
        own = (f"{at} {each.task}", each.outcome, *origin, each.rows, each.left_out, parts.number(lengths[at]))
        table.append((*own, _hertz(rates.get(at)), *map(parts.number, delays), refused))
    head = ("Episode", "Outcome", "Recording", "Events", "Rows", "Left out", "Length, s")
    more = ("Events a second", "Command → feedback, ms", "95 %", "Refused commands")
    words = "Left out: events without a picture within the tolerance. Length: from the first row to the last."
    return parts.table((*head, *more), table, words, left=3)


def _without_rows(notes: DatasetNotes) -> str:
    if not notes.without_rows:
        return ""
    table: list[tuple[parts.Cell, ...]] = []
    for each in notes.without_rows[:MAX_EPISODES]:
        name, origin = f"{each.episode} {each.task}".strip(), f"{each.recording} part {each.part}"
        refused = _refused(None if each.commands is None else each.commands.refused)
        table.append((name, each.outcome, origin, each.left_out, refused))
    head = ("Episode", "Outcome", "Recording", "Events left out", "Refused commands")
    return parts.section("without-rows", "Kept episodes without a row", parts.table(head, table, left=3))


def _widest(rows: list[Row]) -> list[Row]:
    """Return the rows with the largest gaps, one of each episode."""
    best: dict[int, Row] = {}
    for row in rows:
        gap = row.get("lockstep.gap", 0)
        known = best.get(row["episode_index"])
        if gap and (known is None or gap > known["lockstep.gap"]):
            best[row["episode_index"]] = row
    return sorted(best.values(), key=lambda row: -int(row["lockstep.gap"]))[:MAX_SHOWN]


def _pictures(root: Path, camera: str, wanted: set[int], sizes: Mapping[str, int]) -> dict[int, bytes]:
    """Return the pictures of these rows as JPEG, as far as few enough have to be decoded for them.

    Args:
        sizes: number of rows, by file
    """
    found: dict[int, bytes] = {}
    left = MAX_DECODED
    for (file, size), end in zip(sizes.items(), accumulate(sizes.values()), strict=True):
        begin = end - size
        mine = {index - begin for index in wanted if begin <= index < end}
        if not mine:
            continue
        with av.open(str(root / "videos" / camera / f"{file}.mp4")) as video:
            for at, frame in zip(range(min(left, max(mine) + 1)), video.decode(video=0), strict=False):
                left -= 1
                if at in mine:
                    found[begin + at] = jpeg_of(frame, WIDTH)
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
