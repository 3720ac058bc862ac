"""The command `lockstep` on a robot that has no console: `robot`, `ros2` and `check`."""

from importlib.metadata import version
from typing import Annotated

import typer

from lockstep.robot_bridge.cli import robot_app
from lockstep.robot_bridge.conformance.cli import check
from lockstep.robot_bridge.robots.ros2.discovery.cli import ros2_app

__all__ = ["app", "main"]

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Run a robot bridge. The console is not installed here.",
)
app.add_typer(robot_app, name="robot", help="Run a robot and its bridge until interrupted.")
app.add_typer(ros2_app, name="ros2")
app.command()(check)


def _say_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"lockstep {version('lockstep-bridge')}")
        raise typer.Exit


@app.callback()
def lockstep(
    _version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_say_version, is_eager=True)
    ] = False,
) -> None:
    """The options of all commands."""


def main() -> None:
    app(prog_name="lockstep")
