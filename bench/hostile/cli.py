"""`lockstep hostile`."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
import uvloop

from bench.hostile.run import hostile
from bench.processes import ProcessFailed

__all__ = ["hostile_command"]


def hostile_command(
    peers: Annotated[int, typer.Option(min=1, max=500, help="How many misbehave.")] = 100,
    seconds: Annotated[float, typer.Option(min=2, max=600, help="How long they do.")] = 30,
    seed: Annotated[int, typer.Option(help="Of what they do.")] = 1,
    json_file: Annotated[
        str | None, typer.Option("--json", help="Write the figures here; - is standard output.")
    ] = None,
) -> None:
    """Drive among peers that misbehave; ends with 1 when the operator's latency grew by more than a fifth."""
    try:
        figures = uvloop.run(hostile(peers, seconds, seed, lambda text: typer.echo(text, err=True)))
    except ProcessFailed as error:
        typer.echo(f"lockstep: {error}", err=True)
        raise typer.Exit(3) from error
    if json_file == "-":
        sys.stdout.write(json.dumps(figures) + "\n")
    elif json_file is not None:
        Path(json_file).write_text(json.dumps(figures, indent=2) + "\n")
    typer.echo(_summary(figures), err=True)
    raise typer.Exit(int(figures["ratio"] > figures["allowed"]))


def _summary(figures: dict[str, Any]) -> str:
    quiet, disturbed = figures["quiet_ms"], figures["disturbed_ms"]
    lines = [f"{name:8} {quiet[name]:10.2f} ms in peace {disturbed[name]:10.2f} ms among them" for name in quiet]
    return "\n".join([*lines, f"ratio of the medians {figures['ratio']}, allowed {figures['allowed']}"])
