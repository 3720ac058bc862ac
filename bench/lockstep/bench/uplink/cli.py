"""`python -m lockstep.bench.uplink`: drives behind a robot's uplink, with raw pictures and encoded ones in turns."""

import asyncio
import json
import sys
from typing import Annotated, Any

import typer

from lockstep.bench.figures.kept_run import kept_run
from lockstep.bench.figures.machine import busy_percent
from lockstep.bench.uplink.measurement import measure
from lockstep.client import ConsoleError
from lockstep.emulator import load_profile

__all__ = ["app"]

LOOK_SECONDS = 1.5
BUSY_PERCENT = 8.0
WAYS = {"raw": (), "encoded": ("--encode", "h264")}

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def uplink(
    profiles: Annotated[
        list[str] | None, typer.Argument(help="Networks; perfect, robot-512k and robot-lte unless set.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=5, help="Of each drive.")] = 30.0,
    tolerance: Annotated[int, typer.Option(min=1, help="Largest gap of a picture, in events.")] = 4,
    seed: Annotated[int, typer.Option(help="Of the network.")] = 1,
    robot: Annotated[str, typer.Option(help="The simulated robot.")] = "planar",
    turns: Annotated[int, typer.Option(min=1, help="How often each way is measured.")] = 1,
    ways: Annotated[str, typer.Option(help="Of raw and encoded, in this order.")] = "raw,encoded",
) -> None:
    """Bits on the robot link, processor time, and how late and how often pictures reach a client that drives."""
    busy = asyncio.run(busy_percent(LOOK_SECONDS))
    too_much = ": too much to quote the figures" if busy > BUSY_PERCENT else ""
    print(f"others use {busy:.0f} % of this machine{too_much}", file=sys.stderr, flush=True)
    results: list[dict[str, Any]] = []
    for name in profiles or ["perfect", "robot-512k", "robot-lte"]:
        for _ in range(turns):
            for way in ways.split(","):
                try:
                    found = asyncio.run(
                        measure(load_profile(name), robot, WAYS[way], seconds=seconds, tolerance=tolerance, seed=seed)
                    )
                except* (ConsoleError, TimeoutError) as errors:  # such as a link that is too full for heartbeats
                    found = {"not_drivable": ", ".join(map(str, errors.exceptions)) or "the robot was not reached"}
                results.append({"network": name, "way": way, **found})
                print(", ".join(f"{key} {value}" for key, value in results[-1].items()), file=sys.stderr, flush=True)
    sys.stdout.write(json.dumps(kept_run(busy, results), indent=1) + "\n")
