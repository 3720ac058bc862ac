"""`lockstep fleet-soak`."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
import uvloop

from lockstep.bench.fleet_soak.run import FleetPlan, fleet_soak
from lockstep.bench.fleet_soak.verdict import MUST_BE_ZERO
from lockstep.bench.harness.processes import ProcessFailed

__all__ = ["fleet_soak_command"]

EXIT_BROKEN, EXIT_NOT_STARTED = 1, 3


def fleet_soak_command(
    robots: Annotated[int, typer.Option(min=2, max=32, help="Simulated planar robots on one console.")] = 8,
    seconds: Annotated[
        float, typer.Option(min=8, max=36_000, help="How long they drive; in the first quarter no bridge is killed.")
    ] = 120,
    kill_every: Annotated[
        float, typer.Option(min=1, max=600, help="Seconds from one bridge's death to the next.")
    ] = 10,
    rate: Annotated[float, typer.Option(min=1, max=50, help="Events a second of each operator.")] = 20,
    pictures: Annotated[
        bool, typer.Option(help="Whether the robots have cameras, and operators get their pictures.")
    ] = True,
    picture_rate: Annotated[
        float | None, typer.Option(min=1, max=30, help="Pictures a second of one camera, instead of all there are.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the order in which they die.")] = 1,
    json_file: Annotated[
        str | None, typer.Option("--json", help="Write the verdict here; - is standard output.")
    ] = None,
) -> None:
    """Drive several robots on one console while their bridges are killed in turn; ends with 1 when another noticed."""
    plan = FleetPlan(robots, seconds, kill_every, seed, rate, picture_rate if pictures else 0.0)
    try:
        verdict = uvloop.run(fleet_soak(plan, lambda text: typer.echo(text, err=True)))
    except (ProcessFailed, TimeoutError) as error:
        typer.echo(f"lockstep: {error or 'not all robots could be driven in time'}", err=True)
        raise typer.Exit(EXIT_NOT_STARTED) from error
    if json_file == "-":
        sys.stdout.write(json.dumps(verdict) + "\n")
    elif json_file is not None:
        Path(json_file).write_text(json.dumps(verdict, indent=2) + "\n")
    typer.echo(_table(verdict), err=True)
    if any(verdict[name] for name in (*MUST_BE_ZERO, "never_back")):
        raise typer.Exit(EXIT_BROKEN)


def _table(verdict: dict[str, Any]) -> str:
    robots = [f"{name:24} {each}" for name, each in verdict["robots"].items()]
    return "\n".join([f"{name:24} {value}" for name, value in verdict.items() if name != "robots"] + robots)
