"""The command `lockstep drive`. It is the client's, which is imported only when it is asked for."""

from importlib import import_module
from importlib.util import find_spec

import typer

__all__ = ["add_drive_command"]

CLIENT = "lockstep.client"  # another distribution; nothing else here knows of it


def add_drive_command(app: typer.Typer) -> None:
    """Add the command where the client is installed."""
    if find_spec(CLIENT) is None:
        return

    def run(context: typer.Context) -> None:
        raise typer.Exit(import_module(f"{CLIENT}.lead.cli").main(context.args))

    # Its own parser sees everything, --help included.
    everything = {"ignore_unknown_options": True, "allow_extra_args": True}
    about = "Drive a robot's goal axes by a leader arm of LeRobot."
    app.command("drive", help=about, add_help_option=False, context_settings=everything)(run)
