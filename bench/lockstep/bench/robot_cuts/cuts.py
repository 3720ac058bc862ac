"""Cuts a robot's network and judges by the bridge's log: each cut by its own part of it."""

import asyncio
import contextlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lockstep.bench.experiment.judge.outage_judge import Cut, Finding, judge_outage
from lockstep.bench.harness.event_log import Record
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

__all__ = ["RETURN_SECONDS", "cut_once", "figures", "judged", "until_driven", "with_silence"]

BEFORE = 1.5  # s of driving before each cut
BEFORE_LOG = 1.0  # s of the log before a cut that its judge reads
AFTER = 0.5  # s of driving after control returned
PATIENCE = 60.0  # s to wait for control to return
LOOK = 0.1
RETURN_SECONDS = 2.0


async def cut_once(
    log: Path, cut: Callable[[float], None], seconds: float, number: int, say: Callable[[str], None]
) -> Cut:
    """Drive a little, cut for `seconds`, and wait until the bridge's log tells of a moving command again.

    Raises:
        TimeoutError: it did not within a minute.
    """
    await asyncio.sleep(BEFORE)
    began = time.monotonic()
    cut(seconds)
    ended = began + seconds
    await asyncio.sleep(seconds)
    driven = await until_driven(log, ended)
    say(f"cut {number + 1}: driven again {driven - ended:.2f} s after the network's return")
    await asyncio.sleep(AFTER)
    return Cut(began, ended, held=False)


async def until_driven(log: Path, since: float) -> float:
    """Wait until a moving command was executed, by the bridge's log; return when that was."""
    async with asyncio.timeout(PATIENCE):
        place = 0
        while True:
            with contextlib.suppress(FileNotFoundError):
                found, place = await asyncio.to_thread(_read_from, log, place)
                for each in found:
                    if each["kind"] == "executed" and each["time"] >= since and any(each["values"]):
                        return float(each["time"])
            await asyncio.sleep(LOOK)


def _read_from(log: Path, place: int) -> tuple[list[Record], int]:
    """Return the whole lines behind a place of the file, and the next place."""
    with log.open("rb") as lines:
        lines.seek(place)
        data = lines.read()
    whole = data[: data.rfind(b"\n") + 1]
    return [json.loads(line) for line in whole.splitlines()], place + len(whole)


def judged(
    log: list[Record],
    made: list[Cut],
    silence: Callable[[float, float], float],
    intentions: Sequence[tuple[float, float]] = (),
) -> list[Finding]:
    """Return what the bridge's log tells of each cut. `intentions`: (time, value of the first axis); empty: unknown."""
    return [with_silence(_judged(log, cut, intentions), cut, silence) for cut in made]


def _judged(log: list[Record], cut: Cut, intentions: Sequence[tuple[float, float]]) -> Finding:
    """Judge one cut by its own part of the log: up to the first commands that move after the network's return."""
    moved = (each for each in log if each["kind"] == "executed" and each["time"] >= cut.ended and any(each["values"]))
    first = next(moved, None)
    end = cut.ended + PATIENCE if first is None else first["time"] + AFTER
    part = [each for each in log if cut.began - BEFORE_LOG <= each["time"] <= end]
    return judge_outage(
        part,
        cut,
        hold=DESCRIPTION.hold,
        max_event_age=DESCRIPTION.max_event_age,
        intentions=[(at, value) for at, value in intentions if cut.began - BEFORE_LOG <= at <= end],
    )


def figures(findings: list[Finding]) -> dict[str, Any]:
    """Return the figures of all cuts: the worst, in ms, and the verdicts."""
    rests = [finding.rest_seconds for finding in findings]
    backs = [finding.control_seconds for finding in findings]
    intentions = [finding.oldest_intention for finding in findings if finding.oldest_intention is not None]
    known_backs = sorted(back for back in backs if back is not None)
    return {
        "cuts": len(findings),
        "rest_ms_worst": _ms(None if None in rests else max(filter(None, rests), default=None)),
        "rest_ms": [_ms(rest) for rest in rests],
        "hold_ms": _ms(DESCRIPTION.hold),
        "back_ms_median": _ms(known_backs[len(known_backs) // 2] if known_backs else None),
        "back_ms_worst": _ms(None if None in backs else known_backs[-1]),
        "back_ms": [_ms(back) for back in backs],
        "own_outage_ms": [_ms(finding.silent_seconds) for finding in findings],
        "oldest_answer_ms": _ms(max(finding.oldest_answer for finding in findings)),
        "oldest_intention_ms": _ms(max(intentions, default=None)),  # None: unknown
        "max_event_age_ms": _ms(DESCRIPTION.max_event_age),
        "rested_within_hold": sum(finding.rested_within_hold for finding in findings),
        "back_within_2_s": sum(back is not None and back <= RETURN_SECONDS for back in backs),
        "nothing_late": sum(finding.nothing_queued_executed for finding in findings),
    }


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds * 1000, 1)


def with_silence(finding: Finding, cut: Cut, silence: Callable[[float, float], float]) -> Finding:
    """Return the finding with the path's own outages. `silence`: s of them between two times."""
    if finding.control_seconds is None:
        return finding
    return replace(finding, silent_seconds=silence(cut.ended, cut.ended + finding.control_seconds))
