"""`python -m lockstep.bench.three_networks`: a robot, a console and a page behind three routers.

Needs Linux, root and Chromium.
"""

import asyncio
import json
import sys
from typing import Annotated

import typer

from lockstep.bench.figures.kept_run import kept_run
from lockstep.bench.figures.machine import busy_percent
from lockstep.bench.three_networks.run import run

__all__ = ["app"]

LOOK_SECONDS = 1.5

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def three_networks(
    robots: Annotated[
        list[str] | None, typer.Argument(help="Networks of the robot; robot-512k and robot-lte unless set.")
    ] = None,
    page: Annotated[str, typer.Option(help="The page's network.")] = "perfect",
    seconds: Annotated[float, typer.Option(min=1, help="Of each drive, or of each cut.")] = 30.0,
    cuts: Annotated[int, typer.Option(min=0, help="How often the robot's network is cut, SECONDS each time.")] = 0,
    seed: Annotated[int, typer.Option(help="Of the networks.")] = 1,
) -> None:
    """Pair a robot by code, drive it from a page, and say what the page saw."""
    busy = asyncio.run(busy_percent(LOOK_SECONDS))
    print(f"others use {busy:.0f} % of this machine", file=sys.stderr, flush=True)

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    results = []
    for robot in robots or ["robot-512k", "robot-lte"]:
        found = asyncio.run(run(robot, page, seconds, seed, say, cuts=cuts))
        results.append({"robot": robot, "page": page, **found})
    sys.stdout.write(json.dumps(kept_run(busy, results), indent=1) + "\n")
