"""Measures what appending to a dataset costs the operator: `python -m scripts.append_cost [--rounds N]`.

A headless client drives the simulated SO-101, whose two cameras are recorded and encoded. In each round it drives twice
for some seconds: once while `lockstep export --follow` appends the episodes of the round before, and once while that
process is stopped. The order changes from round to round. The figure is command -> feedback, as the client sees it.
"""

import argparse
import asyncio
import math
import os
import signal
import statistics
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.client import CommandRefused, Console

SECONDS = 6.0  # of a drive
WARM = 3.0  # s at first, not counted
TICKS = os.sysconf("SC_CLK_TCK")


async def measure(rounds: int) -> dict[str, list[float]]:
    """Return the delays of the commands, s, with and without the process that appends."""
    delays: dict[str, list[float]] = {"with": [], "without": []}
    busy = 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recordings, state = folder / "recordings", str(folder / "state")
        up = ("up", "--json", "--robot", "so101", "--port", "0", "--robot-port", "0", "--record", str(recordings))
        follow = ("export", "--to", "lerobot", "--follow", "--out", str(folder / "dataset"), "--dir", str(recordings))
        settings = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0", "LOCKSTEP_STATE_DIR": state}
        async with running_process(str(LOCKSTEP), *up, environment=settings) as (_, ready):
            follower = await asyncio.create_subprocess_exec(
                *(str(LOCKSTEP), *follow, "--state-dir", state), stdout=asyncio.subprocess.DEVNULL
            )
            try:
                async with Console(ready["operator"], audio=False) as console:
                    await console.take_seat()
                    await episode(console, WARM)
                    for number in range(rounds):
                        for which in ("with", "without") if number % 2 else ("without", "with"):
                            os.kill(follower.pid, signal.SIGCONT if which == "with" else signal.SIGSTOP)
                            before = cpu_seconds(follower.pid)
                            delays[which] += await episode(console, SECONDS)
                            busy += cpu_seconds(follower.pid) - before
                        sys.stdout.write(line(number + 1, delays, busy))
            finally:
                os.kill(follower.pid, signal.SIGCONT)
                follower.terminate()
                await follower.wait()
    return delays


async def episode(console: Console, seconds: float) -> list[float]:
    """Drive one kept episode; return the delay of each command, s."""
    clock = asyncio.get_running_loop().time
    delays: list[float] = []
    await console.episodes.start("swing")
    end = clock() + seconds
    while clock() < end:
        with suppress(CommandRefused):  # a busy machine has held the robot up
            feedback = await console.arm()
            middle, began = feedback.goals[0] or 0.0, clock()
            while clock() < end:
                sent = clock()
                await console.drive({"shoulder_pan": middle + 0.2 * math.sin(sent - began)})
                delays.append(clock() - sent)
    await console.episodes.success()
    return delays


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def line(rounds: int, delays: dict[str, list[float]], busy: float) -> str:
    parts = [f"{rounds} rounds, it worked for {busy:.1f} s"]
    for quantile in (0.5, 0.95):
        with_, without = (at(delays[which], quantile) * 1000 for which in ("with", "without"))
        parts.append(f"p{quantile * 100:.0f} {with_:.1f} / {without:.1f} ms = {with_ / without:.2f}")
    return "; ".join(parts) + f"; n {len(delays['with'])} / {len(delays['without'])}\n"


def at(values: list[float], quantile: float) -> float:
    return statistics.quantiles(values, n=100)[round(quantile * 100) - 1]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=10)
    asyncio.run(measure(parser.parse_args().rounds))
