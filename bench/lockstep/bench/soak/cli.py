"""`lockstep soak`."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
import uvloop

from lockstep.bench.harness.processes import ProcessFailed
from lockstep.bench.soak.run import soak

__all__ = ["soak_command"]

MUST_BE_ZERO = (
    "executed_twice",
    "executed_late",
    "moved_without_seat",
    "moved_while_stopped",
    "reloads_needed",
    "violations",
)


def soak_command(
    minutes: Annotated[float, typer.Option(min=0.5, max=600, help="How long; 30 is the full soak.")] = 30,
    seed: Annotated[int, typer.Option(help="Of the plan of what goes wrong.")] = 1,
    observers: Annotated[int, typer.Option(min=1, max=100, help="Headless ones, that come and go.")] = 20,
    json_file: Annotated[
        str | None, typer.Option("--json", help="Write the verdict here; - is standard output.")
    ] = None,
) -> None:
    """Drive for a while as bridge, console and network keep failing; ends with 1 when a promise was broken."""
    try:
        verdict = uvloop.run(soak(minutes, seed, observers, lambda text: typer.echo(text, err=True)))
    except ProcessFailed as error:
        typer.echo(f"lockstep: {error}", err=True)
        raise typer.Exit(3) from error
    if json_file == "-":
        sys.stdout.write(json.dumps(verdict) + "\n")
    elif json_file is not None:
        Path(json_file).write_text(json.dumps(verdict, indent=2) + "\n")
    typer.echo(_table(verdict), err=True)
    raise typer.Exit(int(any(verdict[name] for name in MUST_BE_ZERO)))


def _table(verdict: dict[str, Any]) -> str:
    return "\n".join(f"{name:24} {value}" for name, value in verdict.items())
