"""Which console a robot dials, and how it knows it."""

from pathlib import Path
from typing import NamedTuple

from lockstep.robot_bridge.dial.console_address import ConsoleAddress
from lockstep.robot_bridge.dial.console_key import ConsoleKey

__all__ = ["ConsoleAccess"]


class ConsoleAccess(NamedTuple):
    address: ConsoleAddress
    key: ConsoleKey
    authority: Path | None = None  # CA of the console's certificate; None: those that this machine trusts
