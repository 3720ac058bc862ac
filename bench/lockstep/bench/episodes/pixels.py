"""Checks a dataset from its pixels: `python -m lockstep.bench.episodes.pixels DIR`.

It reads the dataset's own files, and shares no code with the export or with `lockstep verify`: rows from the table, the
tolerance from the notes, and the event of each picture from the strip that the robot's bridge has drawn into it.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import av
import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq

from lockstep.bench.episodes.turns import Span

__all__ = ["Pixels", "look", "strip_event"]

LISTED: Final = 20  # of what is wrong
BLACK: Final = 90  # luma; a cell between black and white cannot be read
WHITE: Final = 160
MODULUS: Final = 1 << 31  # event references are serial numbers of 31 bits


@dataclass
class Pixels:
    """What the pictures of a dataset show.

    Attributes:
        tolerance: events, as the dataset states
        pictures: that were decoded, of all cameras
        unreadable: pictures whose strip cannot be read
        outside: pictures that show no event of the row's own last `tolerance` ones
        mislabelled: pictures whose strip differs from the stamp in the row
        gaps: pictures by their distance from the row's event
        rows: by episode of the dataset
        events: of the rows, by episode
        policy: rows that a policy drove
        interventions: rows that a person drove after a policy
        spans: rows by who drove them, by episode
        wrong: what is wrong, in words; the first ones
    """

    tolerance: int = 0
    pictures: int = 0
    unreadable: int = 0
    outside: int = 0
    mislabelled: int = 0
    gaps: dict[int, int] = field(default_factory=dict)
    rows: list[int] = field(default_factory=list)
    events: list[tuple[int, int]] = field(default_factory=list)
    policy: int = 0
    interventions: int = 0
    spans: list[list[Span]] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """All pictures were read, and each is its row's."""
        return self.pictures > 0 and not (self.unreadable or self.outside or self.mislabelled or self.wrong)


def look(root: Path) -> Pixels:
    """Look at every picture of every row. Raises OSError, KeyError: it is no such dataset."""
    notes: dict[str, Any] = json.loads((root / "meta" / "lockstep.json").read_text())
    rows: list[dict[str, Any]] = pq.read_table(sorted((root / "data").rglob("*.parquet"))).to_pylist()
    found = Pixels(tolerance=notes["tolerance"])
    gaps: Counter[int] = Counter()
    for number, camera in enumerate(notes["cameras"]):
        drawn = list(_drawn(root, camera))
        if len(drawn) != len(rows):
            found.wrong.append(f"{camera}: {len(drawn)} pictures for {len(rows)} rows")
        for row, event in zip(rows, drawn, strict=False):
            found.pictures += 1
            _judge(found, gaps, camera, row, event, _stamp(row, number))
    found.policy = sum(row["lockstep.driver_kind"] == "policy" for row in rows)
    found.interventions = sum(bool(row["lockstep.intervention"]) for row in rows)
    found.gaps = dict(sorted(gaps.items()))
    for index in range(len(notes["episodes"])):
        mine = [row for row in rows if row["episode_index"] == index]
        events = [row["lockstep.event"] for row in mine]
        found.rows.append(len(mine))
        found.events.append((min(events), max(events)) if events else (0, 0))
        found.spans.append(_spans(mine))
    del found.wrong[LISTED:]
    return found


def _judge(found: Pixels, gaps: Counter[int], camera: str, row: dict[str, Any], event: int | None, stamp: int) -> None:
    where = f"row {row['index']}, event {row['lockstep.event']}, {camera}"
    if event is None:
        found.unreadable += 1
        found.wrong.append(f"{where}: the strip cannot be read")
        return
    gap = (row["lockstep.event"] - event) % MODULUS
    gaps[gap] += 1
    if gap > found.tolerance:
        found.outside += 1
        found.wrong.append(f"{where}: shows event {event}")
    if event != stamp:
        found.mislabelled += 1
        found.wrong.append(f"{where}: shows event {event}, is stamped {stamp}")


def _drawn(root: Path, camera: str) -> Iterator[int | None]:
    """Yield the event in each picture of a camera, in the order of the rows."""
    for path in sorted((root / "videos" / camera).rglob("*.mp4")):
        with av.open(str(path)) as video:
            for picture in video.decode(video=0):
                yield strip_event(picture.to_ndarray(format="gray"))


def strip_event(luma: npt.NDArray[np.generic]) -> int | None:
    """Return the event in the strip over the top of a picture, shape (H, W); None: it cannot be read.

    The strip is the top twentieth: 32 cells of equal width, white for 1, of which the last makes the number of ones
    even.
    """
    height, width = luma.shape
    rows = height // 20
    band = luma[rows // 4 : rows - rows // 4].astype(float)
    cells = [float(band[:, (4 * at + 1) * width // 128 : (4 * at + 3) * width // 128].mean()) for at in range(32)]
    if any(BLACK <= cell <= WHITE for cell in cells):
        return None
    bits = "".join("1" if cell > WHITE else "0" for cell in cells)
    return (int(bits[:31], 2) or None) if bits.count("1") % 2 == 0 else None


def _spans(rows: list[dict[str, Any]]) -> list[Span]:
    """Return who drove the rows of an episode. A row's action is the command that answered its event."""
    found: list[Span] = []
    for row in rows:
        who = row["lockstep.driver"], row["lockstep.driver_kind"], bool(row["lockstep.intervention"])
        event = row["lockstep.event"] + 1
        if found and found[-1][:3] == who:
            found[-1] = found[-1]._replace(last_event=event)
        else:
            found.append(Span(*who, event, event))
    return found


def _stamp(row: dict[str, Any], camera: int) -> int:
    stamps = row["lockstep.stamp"]
    return int(stamps if isinstance(stamps, int) else stamps[camera])


if __name__ == "__main__":
    seen = look(Path(sys.argv[1]))
    sys.stdout.write(json.dumps(asdict(seen) | {"ok": seen.ok}, indent=1) + "\n")
    sys.exit(0 if seen.ok else 1)
