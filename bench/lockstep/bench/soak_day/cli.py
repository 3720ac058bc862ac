"""`lockstep soak-day`."""

import json
import os
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
import uvloop

from lockstep.bench.harness.processes import ProcessFailed
from lockstep.bench.soak_day.day import Leg, summary
from lockstep.bench.soak_day.leg import run_leg
from lockstep.bench.soak_day.relays import NoAddress

__all__ = ["soak_day_command"]

EXIT_NOT_RUN = 3
LEGS = msgspec.json.Decoder(list[Leg])


def soak_day_command(
    file: Annotated[Path, typer.Argument(help="JSON file with the runs so far; this run is added to it.")],
    minutes: Annotated[float, typer.Option(min=0.0, max=600, help="How long this run lasts; 0: only report.")] = 20,
) -> None:
    """Go on with a day of use that is compressed into two hours; ends with 1 when a promise was broken."""
    legs = _read(file)
    if minutes > 0:
        try:
            leg = uvloop.run(run_leg(minutes, len(legs) + 1, lambda text: typer.echo(text, err=True)))
        except (ProcessFailed, NoAddress, FileNotFoundError) as error:
            typer.echo(f"lockstep: {error}", err=True)
            raise typer.Exit(EXIT_NOT_RUN) from error
        legs.append(leg)
        _write(file, legs)
    found = summary(legs)
    typer.echo(json.dumps(found, indent=2))
    raise typer.Exit(0 if _is_well(found["verdicts"]) else 1)


def _is_well(verdicts: dict[str, Any]) -> bool:
    """Return whether nothing was broken. Figures that a busy machine moves too are reported and end nothing."""
    return bool(verdicts["nothing_broken"])


def _read(file: Path) -> list[Leg]:
    try:
        return LEGS.decode(file.read_bytes())
    except FileNotFoundError:
        return []
    except (OSError, msgspec.DecodeError) as error:
        typer.echo(f"lockstep: {file} is no file of this command: {error}", err=True)
        raise typer.Exit(2) from error


def _write(file: Path, legs: list[Leg]) -> None:
    """Replace the file as a whole, so that an interruption leaves the runs before."""
    new = file.with_name(f"{file.name}.new")
    new.write_bytes(msgspec.json.format(msgspec.json.encode(legs), indent=2) + b"\n")
    os.replace(new, file)
