"""Measures what episodes cost the operator: recording them, and appending them to a dataset meanwhile.

A headless client drives the simulated SO-101, whose two cameras it decodes. Each round drives three times, in an order
that changes: without a recording; an episode that is recorded, while the process that appends is stopped; and an
episode that is recorded while `lockstep export --follow` appends those of before. Needs the arm's model:
lockstep robot fetch so101.
"""

import asyncio
import math
import os
import signal
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlsplit

import httpx

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import quantile
from lockstep.bench.harness.driving import applied_goals, drive_on
from lockstep.bench.harness.processes import ProcessFailed, running_process
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.client import Console, NotArmed
from lockstep.protocol.neutral import neutral_values

__all__ = ["run"]

SECTION = "episodes_cost"
ROBOT = "so101"
ROUNDS, QUICK_ROUNDS = 12, 1
SECONDS = 6.0  # of a drive
WARM = 3.0  # s at first, not counted
ALLOWED_TIMES = 1.1  # the time without a recording
REACH, PERIOD = 0.2, 6.0  # rad, s: how the arm swings
PLAIN, RECORDED, APPENDED = "not recording", "recording", "recording and appending"
KINDS = (PLAIN, RECORDED, APPENDED)
STOP_SECONDS = 30.0
TICKS = os.sysconf("SC_CLK_TCK")
TARGET_SHARE = 0.95  # the largest quantile that has a target


async def run(context: Context) -> list[Result]:
    rounds = context.scale(ROUNDS, QUICK_ROUNDS)
    try:
        trips, worked = await _trips(rounds)
    except ProcessFailed:
        missing = "the SO-101 does not start here: lockstep robot fetch so101"
        return [Result(section=SECTION, name="episodes", value=None, unit="ms", conditions=missing)]
    plain = trips[PLAIN]
    return [
        Result(
            section=SECTION,
            name=f"{ROBOT}: command → feedback, {kind}, {name}",
            value=quantile(trips[kind], share),
            unit="ms",
            target=None if share > TARGET_SHARE else quantile(plain, share) * ALLOWED_TIMES,
            baseline=quantile(plain, share),
            baseline_name="the same, not recording, in turns with it",
            samples=len(trips[kind]),
            conditions="pictures of all cameras received, decoded and recorded; the process that appends worked for "
            f"{worked:.0f} of {rounds * SECONDS:.0f} s",
        )
        for kind in (RECORDED, APPENDED)
        for name, share in (("median", 0.5), ("p95", 0.95), ("p99", 0.99))
    ]


async def _trips(rounds: int) -> tuple[dict[str, list[float]], float]:
    """Return the times from command to feedback in ms, by kind, and the processor time of appending in s."""
    trips: dict[str, list[float]] = {kind: [] for kind in KINDS}
    worked = 0.0
    with TemporaryDirectory(prefix="lockstep-bench-") as name:
        async with (
            _recorded(Path(name)) as (operator, follower),
            Console(operator, audio=False) as console,
            httpx.AsyncClient(base_url="://".join(urlsplit(operator)[:2]), trust_env=False) as http,
        ):
            http.headers["Authorization"] = f"Bearer {operator.partition('token=')[2].partition('&')[0]}"
            await console.take_seat()
            await _episode(console, http, WARM)
            for number in range(rounds):
                turned = number % len(KINDS)
                for kind in (*KINDS[turned:], *KINDS[:turned]):
                    os.kill(follower, signal.SIGCONT if kind == APPENDED else signal.SIGSTOP)
                    before = _cpu_seconds(follower)
                    trips[kind] += await (
                        _drive(console, SECONDS) if kind == PLAIN else _episode(console, http, SECONDS)
                    )
                    worked += _cpu_seconds(follower) - before
    return trips, worked


@asynccontextmanager
async def _recorded(folder: Path) -> AsyncIterator[tuple[str, int]]:
    """Run console, robot, and the process that appends; give the operator's link, and the number of that process."""
    recordings, state = folder / "state" / "recordings", str(folder / "state")
    console = ("up", "--json", "--robot", ROBOT, "--port", "0", "--robot-port", "0")
    follow = ("export", "--to", "lerobot", "--follow", "--out", str(folder / "dataset"), "--dir", str(recordings))
    settings = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0", "LOCKSTEP_STATE_DIR": state}
    recordings.mkdir(parents=True)
    async with running_process(LOCKSTEP, *console, environment=settings) as (_, ready):
        follower = await asyncio.create_subprocess_exec(
            *(LOCKSTEP, *follow, "--state-dir", state), stdout=asyncio.subprocess.DEVNULL
        )
        try:
            yield ready["operator"], follower.pid
        finally:
            follower.send_signal(signal.SIGCONT)
            follower.terminate()
            try:
                await asyncio.wait_for(follower.wait(), STOP_SECONDS)
            except TimeoutError:
                follower.kill()
                await follower.wait()


async def _episode(console: Console, http: httpx.AsyncClient, seconds: float) -> list[float]:
    """Drive a kept episode, in a recording of its own."""
    (await http.post("/api/recordings")).raise_for_status()
    await console.episodes.start("swing")
    trips = await _drive(console, seconds)
    await console.episodes.success()
    (await http.post("/api/recordings/stop")).raise_for_status()
    return trips


async def _drive(console: Console, seconds: float) -> list[float]:
    """Swing the arm; return the time from each command to its feedback, in ms."""
    neutral = neutral_values(console.description.axes)
    pan = next(number for number, axis in enumerate(console.description.axes) if axis.name == "shoulder_pan")
    trips: list[float] = []
    end = time.monotonic() + seconds
    while (began := time.monotonic()) < end:
        await drive_on(console, neutral)
        middle = applied_goals(console)[pan] or 0.0
        values: list[float | None] = list(neutral)
        try:
            while (sent := time.monotonic()) < end:
                values[pan] = middle + REACH * math.sin((sent - began) / PERIOD * math.tau)
                await console.drive(values)
                trips.append((time.monotonic() - sent) * 1000)
        except NotArmed:  # a busy machine has held the robot up
            continue
    return trips


def _cpu_seconds(pid: int) -> float:
    """The processor time of a process so far (proc(5), /proc/PID/stat)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS
