"""`lockstep interoperability`."""

from pathlib import Path
from typing import Annotated, get_args

import msgspec
import typer
import uvloop

from lockstep.bench.interoperability.cells import Found, seconds_of, table_of, wanted
from lockstep.bench.interoperability.names import Client, Way
from lockstep.bench.interoperability.run import run_cell
from lockstep.emulator.errors import NamespacesUnavailable

__all__ = ["interoperability_command"]

_results = msgspec.json.Decoder(dict[str, Found])


def interoperability_command(
    results: Annotated[
        Path, typer.Argument(help="A file that keeps what was found; a run goes on where the last one ended.")
    ],
    client: Annotated[list[str] | None, typer.Option(help=f"Only this one: {', '.join(get_args(Client))}.")] = None,
    way: Annotated[list[str] | None, typer.Option(help=f"Only this one: {', '.join(get_args(Way))}.")] = None,
    scale: Annotated[
        float, typer.Option(min=0.01, max=100, help="Of the times: 20 minutes by UDP, one minute each other way.")
    ] = 1.0,
    again: Annotated[bool, typer.Option("--again", help="Also what was found to work.")] = False,
) -> None:
    """Drive or watch with each client over each kind of network, and keep a table; ends with 1 when one fails.

    Needs root, for network namespaces, and a checkout with the development packages.
    """
    for given, names in ((client, get_args(Client)), (way, get_args(Way))):
        if strange := set(given or ()) - set(names):
            typer.echo(f"lockstep: no {', '.join(sorted(strange))}; there are {', '.join(names)}", err=True)
            raise typer.Exit(2)
    try:
        known = _results.decode(results.read_bytes()) if results.exists() else {}
    except (OSError, msgspec.DecodeError) as error:
        typer.echo(f"lockstep: {results} cannot be read: {error}", err=True)
        raise typer.Exit(2) from error
    cells = wanted(known, clients=client or (), ways=way or (), again=again)
    for cell in cells:
        try:
            found = uvloop.run(run_cell(cell, seconds_of(cell, scale), lambda text: typer.echo(text, err=True)))
        except (FileNotFoundError, NamespacesUnavailable) as error:
            typer.echo(f"lockstep: {error}", err=True)
            raise typer.Exit(3) from error
        known[str(cell)] = found
        results.write_bytes(msgspec.json.format(msgspec.json.encode(known)) + b"\n")
        typer.echo(f"{cell}: {found.verdict}", err=True)
    typer.echo(table_of(known))
    raise typer.Exit(int(any(known[str(cell)].verdict != "ok" for cell in cells)))
