"""`python -m lockstep.bench.second_encoding`: an operator on a narrow path and an observer on a wide one.

Each robot's network is tried with the second encoding and without it, in turns. Needs Linux and root.
"""

import asyncio
import json
import sys
from typing import Annotated, Any

import typer

from lockstep.bench.figures.kept_run import kept_run
from lockstep.bench.figures.machine import busy_percent
from lockstep.bench.second_encoding.run import run

__all__ = ["app"]

LOOK_SECONDS = 1.5

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def second_encoding(
    robots: Annotated[
        list[str] | None, typer.Argument(help="Networks of the robot; robot-512k and robot-lte unless set.")
    ] = None,
    operator_kbps: Annotated[float, typer.Option(min=100, help="What the operator's path carries.")] = 300.0,
    seconds: Annotated[float, typer.Option(min=1, help="Of each drive, after half a minute.")] = 60.0,
    turns: Annotated[int, typer.Option(min=1, help="How often each way is measured.")] = 1,
    robot: Annotated[str, typer.Option(help="The simulated robot.")] = "planar",
    seed: Annotated[int, typer.Option(help="Of the networks.")] = 1,
) -> None:
    """Say what the operator and the observer saw, and how many bits the robot sent."""
    busy = asyncio.run(busy_percent(LOOK_SECONDS))
    print(f"others use {busy:.0f} % of this machine", file=sys.stderr, flush=True)
    results: list[dict[str, Any]] = []
    for network in robots or ["robot-512k", "robot-lte"]:
        for turn in range(turns):
            for second in (False, True):
                found = asyncio.run(run(network, robot, operator_kbps * 1000, seconds, seed=seed + turn, second=second))
                results.append({"network": network, "second": second, **found})
                print(json.dumps(results[-1]), file=sys.stderr, flush=True)
    sys.stdout.write(json.dumps(kept_run(busy, results), indent=1) + "\n")
