"""The entry point of the command `lockstep`: the console's commands if that is installed, else a robot's alone."""

import gc
from importlib import import_module
from importlib.util import find_spec

__all__ = ["main"]

CONSOLE = "lockstep.server"  # another distribution; nothing else here knows of it


def main() -> None:
    """Run the command. Collecting garbage during the imports would take a sixth of the start, and find none."""
    gc.disable()
    installed = find_spec(CONSOLE) is not None
    commands = import_module(f"{CONSOLE}.cli.main" if installed else "lockstep.robot_bridge.commands")
    gc.enable()
    commands.main()
