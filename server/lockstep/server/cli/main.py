"""The command `lockstep`. The code of a command is loaded when that command is asked for: few need all of it."""

import faulthandler
import gc
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from lockstep.server.cli.driving import add_drive_command
from lockstep.server.cli.measurements import add_bench_commands

__all__ = ["LOADERS", "app", "main"]


def _console() -> typer.Typer:
    from lockstep.server.cli.console.consoles import commands

    return commands


def _robot() -> typer.Typer:
    from lockstep.robot_bridge.cli import robot_app

    commands = typer.Typer()
    commands.add_typer(robot_app, name="robot", help="Run a robot and its bridge until interrupted.")
    return commands


def _ros2() -> typer.Typer:
    from lockstep.robot_bridge.robots.ros2.discovery.cli import ros2_app

    commands = typer.Typer()
    commands.add_typer(ros2_app, name="ros2")
    return commands


def _check() -> typer.Typer:
    from lockstep.robot_bridge.conformance.cli import check

    commands = typer.Typer()
    commands.command()(check)
    return commands


def _access() -> typer.Typer:
    from lockstep.server.cli.access.access import add_access_commands
    from lockstep.server.cli.settings_from_flags import make_settings

    commands = typer.Typer()
    add_access_commands(commands, make_settings)
    return commands


def _pairing() -> typer.Typer:
    from lockstep.server.cli.access.pairing import add_pairing_commands
    from lockstep.server.cli.settings_from_flags import make_settings

    commands = typer.Typer()
    add_pairing_commands(commands, make_settings)
    return commands


def _recordings() -> typer.Typer:
    from lockstep.server.cli.recordings.episodes import add_episode_command
    from lockstep.server.cli.recordings.export import add_export_command
    from lockstep.server.cli.recordings.recordings import add_recording_commands
    from lockstep.server.cli.settings_from_flags import make_settings

    commands = typer.Typer()
    add_recording_commands(commands, make_settings)
    add_episode_command(commands, make_settings)
    add_export_command(commands, make_settings)
    return commands


# In the order of `lockstep --help`; each group has these commands and no others.
LOADERS: dict[Callable[[], typer.Typer], tuple[str, ...]] = {
    _console: ("up", "serve"),
    _robot: ("robot",),
    _ros2: ("ros2",),
    _check: ("check",),
    _access: ("invite", "invitations", "revoke", "audit"),
    _pairing: ("pair", "forget"),
    _recordings: ("record", "recordings", "replay", "episodes", "verify", "export", "report"),
}


@cache
def _group(load: Callable[[], typer.Typer]) -> TyperGroup:
    gc.disable()  # as in robot_bridge/lockstep/robot_bridge/entry.py
    try:
        return typer.main.get_group(load())
    finally:
        gc.enable()


class LazyGroup(TyperGroup):
    """Knows the names of all commands, and loads one of them when it is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:
        return [*(name for names in LOADERS.values() for name in names), *super().list_commands(ctx)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        for load, names in LOADERS.items():
            if cmd_name in names:
                return _group(load).get_command(ctx, cmd_name)
        return super().get_command(ctx, cmd_name)


app = typer.Typer(
    cls=LazyGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Drive a robot from a browser. `lockstep up` runs a simulated robot and the console.",
)
add_drive_command(app)
add_bench_commands(app)


def _say_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"lockstep {version('lockstep-console')}")
        raise typer.Exit


@app.callback()
def lockstep(
    _version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_say_version, is_eager=True)
    ] = False,
) -> None:
    """The options of all commands."""


def main() -> None:
    faulthandler.enable()  # a crash in a library's native code says where every thread was
    app()
