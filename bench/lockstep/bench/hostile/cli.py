"""`lockstep hostile`."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
import uvloop

from lockstep.bench.harness.processes import ProcessFailed
from lockstep.bench.hostile.crowd import KINDS
from lockstep.bench.hostile.run import FRONTS, hostile

__all__ = ["hostile_command"]


def hostile_command(
    peers: Annotated[int, typer.Option(min=1, max=500, help="How many misbehave.")] = 100,
    seconds: Annotated[float, typer.Option(min=2, max=600, help="How long they do.")] = 30,
    seed: Annotated[int, typer.Option(help="Of what they do.")] = 1,
    kind: Annotated[
        list[str] | None, typer.Option(help="One kind of misbehaviour alone; again for more, each alone.")
    ] = None,
    each: Annotated[bool, typer.Option("--each", help="Every kind alone.")] = False,
    front: Annotated[str, typer.Option(help="How they come: direct, tls or caddy.")] = "direct",
    json_file: Annotated[
        str | None, typer.Option("--json", help="Write the figures here; - is standard output.")
    ] = None,
) -> None:
    """Drive among peers that misbehave; ends with 1 when the operator's latency grew by more than a fifth."""
    known = [each_kind.__name__ for each_kind in KINDS]
    if front not in FRONTS or not set(kind or ()) <= set(known):
        typer.echo(f"lockstep: the fronts are {', '.join(FRONTS)}; the kinds are {', '.join(known)}", err=True)
        raise typer.Exit(2)
    found = list[dict[str, Any]]()
    kinds, failed = known if each else kind or [""], False
    for one in kinds:
        try:
            found.append(uvloop.run(hostile(peers, seconds, seed, lambda text: typer.echo(text, err=True), one, front)))
        except ProcessFailed as error:  # the figures of the others are still useful
            typer.echo(f"lockstep: {one or 'all kinds'}: {error}", err=True)
            failed = True
        else:
            typer.echo(_row(found[-1]), err=True)
    if not found:
        raise typer.Exit(3)
    figures = found if len(kinds) > 1 else found[0]
    if json_file == "-":
        sys.stdout.write(json.dumps(figures) + "\n")
    elif json_file is not None:
        Path(json_file).write_text(json.dumps(figures, indent=2) + "\n")
    typer.echo(_summary(found[0]) if len(kinds) == 1 else _table(found), err=True)
    raise typer.Exit(3 if failed else int(any(one["ratio"] > one["allowed"] for one in found)))


def _table(found: list[dict[str, Any]]) -> str:
    """Return a row for each kind. The crowd's own processor time shows whether it could do anything at all."""
    head = "kind                  attempts  in peace  among them  ratio  p95 among  crowd s"
    return "\n".join([head, *map(_row, found)])


def _row(one: dict[str, Any]) -> str:
    attempts = sum(one["crowd"]["attempts"].values())
    quiet, disturbed = one["quiet_ms"], one["disturbed_ms"]
    return (
        f"{one['kind']:20} {attempts:9} {quiet['median']:9.2f} {disturbed['median']:11.2f} {one['ratio']:6.2f}"
        f" {disturbed['p95']:10.2f} {one['crowd_cpu_seconds']:8.1f}"
    )


def _summary(figures: dict[str, Any]) -> str:
    quiet, disturbed = figures["quiet_ms"], figures["disturbed_ms"]
    lines = [f"{name:8} {quiet[name]:10.2f} ms in peace {disturbed[name]:10.2f} ms among them" for name in quiet]
    return "\n".join([*lines, f"ratio of the medians {figures['ratio']}, allowed {figures['allowed']}"])
