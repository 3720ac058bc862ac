"""Makes the dataset with the product's own commands, and compares it with what was kept."""

import asyncio
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from lockstep.bench.episodes.turns import Span, Turn, differences
from lockstep.bench.harness.stack import LOCKSTEP

__all__ = ["Kept", "export", "judged", "verify"]

EXPORT_SECONDS: Final = 900.0
SUCCESS: Final = {"success": 1, "failure": 0, "": -1}


class Kept(NamedTuple):
    """An episode that has to be in the dataset, as its drivers saw it."""

    episode: str  # id
    outcome: str
    first_event: int  # in the console's state when it began
    last_event: int  # of the last command in it that was answered
    turns: tuple[Turn, ...]
    person: str  # who began it


async def export(recordings: Sequence[Path], root: Path, *, append: bool = False) -> str:
    """Export to a new folder, or append, by `lockstep export`; return "" or what it said when it failed."""
    command = (LOCKSTEP, "export", *map(str, recordings), "--to", "lerobot", "--out", str(root))
    command += ("--append",) if append else ()
    done = await asyncio.to_thread(
        subprocess.run, command, capture_output=True, text=True, timeout=EXPORT_SECONDS, check=False
    )
    return "" if done.returncode == 0 else done.stderr.strip() or f"exit code {done.returncode}"


async def verify(root: Path) -> bool:
    """Return whether `lockstep verify` finds nothing."""
    command = (LOCKSTEP, "verify", str(root))
    done = await asyncio.to_thread(subprocess.run, command, capture_output=True, timeout=EXPORT_SECONDS, check=False)
    return done.returncode == 0


async def judged(root: Path, kept: Sequence[Kept]) -> dict[str, Any]:
    """Return what a dataset is like, from its pixels and beside what was kept. `wrong` is empty where all is right."""
    command = (sys.executable, "-m", "lockstep.bench.episodes.pixels", str(root))
    done = await asyncio.to_thread(
        subprocess.run, command, capture_output=True, text=True, timeout=EXPORT_SECONDS, check=False
    )
    if not done.stdout:
        return {"wrong": [done.stderr.strip()]}
    pixels: dict[str, Any] = json.loads(done.stdout)
    notes: dict[str, Any] = json.loads((root / "meta" / "lockstep.json").read_text())
    pixels["verified"] = await verify(root)
    pixels["left_out"] = [each["left_out"] for each in notes["episodes"]]
    pixels["wrong"] += [] if pixels["verified"] else ["lockstep verify finds something"]
    pixels["wrong"] += list(_differences(notes["episodes"], pixels, kept))
    pixels["expected"] = [each._asdict() for each in kept]
    return pixels


def _differences(found: list[dict[str, Any]], pixels: dict[str, Any], kept: Sequence[Kept]) -> list[str]:
    """Return in words where the dataset is not exactly what was kept."""
    ids, wanted = [each["episode"] for each in found], [each.episode for each in kept]
    if ids != wanted:
        missing = ", ".join(sorted(set(wanted) - set(ids))) or "none"
        more = ", ".join(sorted(set(ids) - set(wanted))) or "none"
        return [f"other episodes than the kept ones: missing {missing}, too many {more}, or in another order"]
    wrong: list[str] = []
    for index, (each, own) in enumerate(zip(found, kept, strict=True)):
        first, last = pixels["events"][index]
        if each["outcome"] != own.outcome:
            wrong.append(f"episode {index}: outcome {each['outcome']!r}, kept as {own.outcome!r}")
        if each["first_event"] != own.first_event or not own.first_event <= first <= last:
            wrong.append(f"episode {index} begins at {each['first_event']} and {first}, not at {own.first_event}")
        if last > each["last_event"] or each["last_event"] < own.last_event:
            wrong.append(f"episode {index} ends at {each['last_event']}, its rows at {last}, not at {own.last_event}")
        spans = [Span(*each) for each in pixels["spans"][index]]
        wrong += [f"episode {index}: {said}" for said in differences(spans, own.turns, own.person)]
    return wrong
