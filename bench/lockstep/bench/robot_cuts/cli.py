"""`python -m lockstep.bench.robot_cuts`: cuts a robot's network in mid-drive, by default twenty times for 10 s.

Needs Linux and root: the robot is in a network namespace of its own.
"""

import asyncio
import json
import sys
from typing import Annotated, Literal

import typer

from lockstep.bench.figures.kept_run import kept_run
from lockstep.bench.figures.machine import busy_percent
from lockstep.bench.robot_cuts.cuts import figures
from lockstep.bench.robot_cuts.run import run_cuts

__all__ = ["app"]

LOOK_SECONDS = 1.5
BUSY_PERCENT = 8.0

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def robot_cuts(
    cuts: Annotated[int, typer.Option(min=1, help="How often the network is cut.")] = 20,
    seconds: Annotated[float, typer.Option(min=0.5, help="How long, each time.")] = 10.0,
    way: Annotated[
        Literal["reached", "dial-in", "behind-nat"],
        typer.Option(
            help="The console connects to the robot, the robot dials in, or it does so and all are behind routers."
        ),
    ] = "reached",
    network: Annotated[str, typer.Option(help="The robot's, for behind-nat.")] = "robot-lte",
    seed: Annotated[int, typer.Option(help="Of the network.")] = 1,
) -> None:
    """Cut the network, and tell by the bridge's log whether the robot rested, came back, and did nothing late."""
    busy = asyncio.run(busy_percent(LOOK_SECONDS))
    print(f"others use {busy:.0f} % of this machine", file=sys.stderr, flush=True)

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    found = figures(asyncio.run(run_cuts(way, cuts, seconds, seed, say, network=network)))
    network = network if way == "behind-nat" else "40 ms of round trip"
    run = {"way": way, "network": network, "seconds": seconds, **found}
    print(json.dumps(kept_run(busy, [run]), indent=1))
    held = (found["rested_within_hold"], found["back_within_2_s"], found["nothing_late"])
    if held != (cuts, cuts, cuts):
        raise typer.Exit(1)
