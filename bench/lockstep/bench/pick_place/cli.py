"""`python -m lockstep.bench.pick_place`: puts blocks into the bowl with the SO-101, ten by default.

Needs the arm's model: lockstep robot fetch so101.
"""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
import uvloop

from lockstep.bench.figures.kept_run import kept_run
from lockstep.bench.figures.machine import busy_percent
from lockstep.bench.harness.processes import ProcessFailed
from lockstep.bench.pick_place.operator import HandName, OperatorFailed
from lockstep.bench.pick_place.run import Choices, pick_and_place
from lockstep.client.errors import ConsoleError
from lockstep.emulator.errors import ProfileError

__all__ = ["app", "is_kept"]

ROUNDING = 1e-3  # of the largest step
EXIT_FAILED = 3

LOOK_SECONDS = 1.5

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def command(
    network: Annotated[str, typer.Option(help="A profile of lockstep network, such as hong-kong; unset: none.")] = "",
    times: Annotated[int, typer.Option(min=1, max=1000, help="How many blocks.")] = 10,
    hand: Annotated[
        HandName,
        typer.Option(
            help="tool: goals of the tool's pose. leader: a leader arm through the clutch. policy: joint positions. "
            "pad, headset: the page in Chromium with an emulated gamepad, or with an emulated headset's controllers."
        ),
    ] = "tool",
    seed: Annotated[int, typer.Option(help="Of the network.")] = 1,
    pictures: Annotated[bool, typer.Option(help="The client takes and shows the pictures of both cameras.")] = True,
    keep: Annotated[Path | None, typer.Option(help="Keep the recordings and the bridge's log in this folder.")] = None,
    json_to: Annotated[str, typer.Option("--json", help="Write the figures there; - is standard output.")] = "",
) -> None:
    """Put blocks into the bowl through a console, record and verify each; ends with 1 when a promise is not kept."""
    busy = uvloop.run(busy_percent(LOOK_SECONDS))
    try:
        figures = uvloop.run(pick_and_place(Choices(network, times, hand, seed, pictures, keep), _say))
    except ProfileError as error:
        raise typer.BadParameter(str(error)) from error
    except (ProcessFailed, ConsoleError, OperatorFailed, TimeoutError, AssertionError) as error:
        _say(str(error) or "the robot does not say that the bowl is empty")
        raise typer.Exit(EXIT_FAILED) from error
    _say(_summary(figures))
    text = json.dumps(kept_run(busy, [figures]), indent=1) + "\n"
    if json_to == "-":
        sys.stdout.write(text)
    elif json_to:
        Path(json_to).write_text(text)
    raise typer.Exit(0 if is_kept(figures) else 1)


def is_kept(figures: dict[str, Any]) -> bool:
    """Return whether each block lies in the bowl, with no jump, no step above a limit, and all verified."""
    whole = figures["placed"] == figures["verified"] == figures["of"]
    return bool(whole and figures["jumps"] == figures["violations"] == 0 and figures["largest_step"] <= 1 + ROUNDING)


def _summary(figures: dict[str, Any]) -> str:
    return (
        f"{figures['hand']}, {figures['network'] or 'no network'}: {figures['placed']} of {figures['of']} in the bowl, "
        f"{figures['jumps']} jumps, largest step {figures['largest_step']:.2f}, {figures['verified']} verified, "
        f"{figures['pictures']} pictures, {figures['violations']} beyond the tolerance"
    )


def _say(text: str) -> None:
    typer.echo(f"pick_place: {text}", err=True)
