"""Runs cells one after the other: starts a world, runs a client for its time, and returns the result."""

import asyncio
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from lockstep.bench.harness.processes import ProcessFailed
from lockstep.bench.interoperability.cells import Cell, Found
from lockstep.bench.interoperability.world import World, running_world
from lockstep.emulator.errors import NamespacesUnavailable

__all__ = ["run_cell"]

EXAMPLES = Path(__file__).resolve().parents[4] / "docs" / "examples"
SLACK_SECONDS = 150.0  # for opening, on the longest path, and for the end
WATCHERS = ("gstreamer", "janus")  # a helper drives beside them
PICTURE = re.compile(r"event (\d+), gap (-?\d+), (shown|left out)")
TOLERANCE = 4  # events


async def run_cell(cell: Cell, seconds: float, say: Callable[[str], None]) -> Found:
    """Run one cell.

    Raises:
        FileNotFoundError, NamespacesUnavailable: this machine lacks something.
    """
    say(f"{cell}: {seconds:g} s")
    try:
        async with running_world(cell.way, cell.client) as world:
            results = await asyncio.gather(
                *(_visit(world, cell, number, seconds) for number in range(len(world.links)))
            )
    except (FileNotFoundError, NamespacesUnavailable):
        raise
    except (ProcessFailed, RuntimeError, OSError, ValueError, TimeoutError) as error:
        return Found(seconds=seconds, trouble=_short(str(error) or type(error).__name__), commit=_commit())
    worst = min(results, key=lambda found: found["pictures"])
    return Found(
        seconds=seconds,
        pictures=worst["pictures"],
        events=min(found["events"] for found in results),
        violations=sum(found["violations"] for found in results),
        reconnections=sum(found["reconnections"] for found in results),
        commit=_commit(),
    )


async def _visit(world: World, cell: Cell, number: int, seconds: float) -> dict[str, Any]:
    link = world.links[number]["observer" if cell.client in WATCHERS else "operator"]
    if cell.client in WATCHERS:
        await world.drive(number)
    if cell.client == "aiortc":
        example = str(EXAMPLES / "aiortc" / "drive.py")
        found = await _last_json(world, [sys.executable, example, link, "--seconds", str(seconds)], seconds)
        return {"pictures": found["pictures"], "events": found["event"], "violations": 0, "reconnections": 0}
    if cell.client == "gstreamer":
        return await _gstreamer(world, link, seconds)
    command = [sys.executable, "-m", "lockstep.bench.interoperability.visitor", cell.client, link, str(seconds)]
    # A headless client at loopback would take loopback for the way of its media too.
    door = world.doors[number] if cell.client != "headless" else ""
    return await _last_json(world, [*command, door], seconds)


async def _last_json(world: World, command: list[str], seconds: float) -> dict[str, Any]:
    visitor = await world.visit(command)
    async with asyncio.timeout(seconds + SLACK_SECONDS):
        status = await visitor.wait()
    said = visitor.output.said()
    if status != 0 or not said:
        raise RuntimeError(visitor.output.lines[-1] if visitor.output.lines else f"it ended with {status}")
    return said[-1]


async def _gstreamer(world: World, link: str, seconds: float) -> dict[str, Any]:
    """Run the example, which prints a line for each picture, until it is interrupted."""
    python = shutil.which("python3", path="/usr/bin") or "python3"  # Debian's, whose packages the example needs
    visitor = await world.visit([python, str(EXAMPLES / "gstreamer" / "watch.py"), link])
    await visitor.line(PICTURE.pattern, SLACK_SECONDS)
    shown = violations = newest = 0
    end = time.monotonic() + seconds
    while time.monotonic() < end and visitor.process.returncode is None:
        said = [match for line in visitor.output.lines if (match := PICTURE.fullmatch(line)) is not None]
        visitor.output.lines.clear()
        for event, gap, fate in (match.groups() for match in said):
            newest = int(event)
            shown += fate == "shown"
            violations += fate == "shown" and abs(int(gap)) > TOLERANCE
        visitor.output.grew.clear()
        with suppress(TimeoutError):
            async with asyncio.timeout(1.0):
                await visitor.output.grew.wait()
    if visitor.process.returncode is not None:
        raise RuntimeError(f"it ended with {visitor.process.returncode}")
    visitor.signal(signal.SIGINT)
    return {"pictures": shown, "events": newest, "violations": violations, "reconnections": 0}


def _short(text: str) -> str:
    return text.strip().splitlines()[-1][:200].replace("|", "/")


def _commit() -> str:
    done = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    return done.stdout.strip()
