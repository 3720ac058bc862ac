"""`python -m lockstep.bench.link_transports [--seconds S] [--turns N] [--json FILE]`: needs Linux and root."""

import asyncio
import datetime
import json
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from lockstep.bench.figures.kept_run import kept_run
from lockstep.bench.figures.machine import busy_percent
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.link_transports.ends import CHAIN, KEY
from lockstep.bench.link_transports.transports import KINDS, Kind
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.impairment import Impairment
from lockstep.emulator.impairment.loss import independent
from lockstep.emulator.impairment.profile import even_profile
from lockstep.emulator.namespace.namespaces import OPERATOR_ADDRESS, Namespaces
from lockstep.server.http.transport.tls import self_signed

__all__ = ["main"]

PORT = 9000
ROUND_TRIPS = (0.02, 0.1)  # s
LOOK_SECONDS = 1.5
PATIENCE = 60.0  # s on top of the measurement itself

Times = dict[str, list[float]]


async def measure(kind: Kind, round_trip: float, loss: float, seconds: float, seed: int) -> Times:
    """Run both ends in namespaces of their own, and return what the console's end measured."""
    impairment = Impairment(delay=Constant(round_trip / 2), loss=independent(loss))
    with TemporaryDirectory(prefix="lockstep-link-") as directory:
        folder = Path(directory)
        made = self_signed(folder, {OPERATOR_ADDRESS}, datetime.datetime.now(datetime.UTC))
        shutil.copy(made.chain, folder / CHAIN)
        shutil.copy(made.key, folder / KEY)
        async with Namespaces(even_profile("link", impairment), seed=seed) as spaces:
            words = (kind, OPERATOR_ADDRESS, str(PORT), str(seconds), directory)
            program = (sys.executable, "-m", "lockstep.bench.link_transports.ends")
            console = await spaces.start("operator", (*program, "console", *words), stdout=asyncio.subprocess.PIPE)
            if console.stdout is None:
                raise RuntimeError("the console's end has no output")
            async with asyncio.timeout(seconds + PATIENCE):
                await console.stdout.readline()  # it listens
                await spaces.start("robot", (*program, "robot", *words))
                output = await console.stdout.read()
    found: Times = json.loads(output)
    return found


def run(
    seconds: Annotated[float, typer.Option(help="Of each turn.")] = 30.0,
    turns: Annotated[int, typer.Option(help="Of each transport on each path.")] = 3,
    losses: Annotated[str, typer.Option(help="Of the paths, in %, after commas.")] = "0,2",
    transports: Annotated[str, typer.Option(help="After commas.")] = ",".join(KINDS),
    json_to: Annotated[Path | None, typer.Option("--json", help="Write the figures there.")] = None,
) -> None:
    """Measure command to feedback and the delay of pictures, on each path and by each transport in turns."""
    kinds = [kind for kind in KINDS if kind in transports.split(",")]
    busy = asyncio.run(busy_percent(LOOK_SECONDS))
    rows = []
    for round_trip in ROUND_TRIPS:
        for loss in (float(percent) / 100 for percent in losses.split(",")):
            found: dict[Kind, Times] = {kind: {"trips": [], "pictures": []} for kind in kinds}
            for turn in range(turns):
                for kind in kinds:
                    times = asyncio.run(measure(kind, round_trip, loss, seconds, turn + 1))
                    for name, values in times.items():
                        found[kind][name] += values
            rows += [_row(kind, round_trip, loss, times) for kind, times in found.items()]
            for row in rows[-len(kinds) :]:
                print(json.dumps(row), flush=True)
    if json_to is not None:
        json_to.write_text(json.dumps(kept_run(busy, rows), indent=1) + "\n")


def _row(kind: Kind, round_trip: float, loss: float, times: Times) -> dict[str, float | str]:
    row: dict[str, float | str] = {"transport": kind, "round_trip_ms": 1000 * round_trip, "loss_percent": 100 * loss}
    for name, values in times.items():
        row |= {
            f"{name}_p50_ms": round(median(values), 1),
            f"{name}_p95_ms": round(quantile(values, 0.95), 1),
            f"{name}_p99_ms": round(quantile(values, 0.99), 1),
            f"{name}_count": len(values),
        }
    return row


def main() -> None:
    typer.run(run)
