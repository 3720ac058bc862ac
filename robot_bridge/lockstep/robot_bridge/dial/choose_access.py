"""Which console `lockstep robot` dials: by a code that pairs now, a key file, or what it was paired with before."""

import asyncio
import importlib.util
import logging
import sys
from pathlib import Path

from lockstep.protocol.dial_in import PairingCode
from lockstep.robot_bridge.dial.console_access import ConsoleAccess
from lockstep.robot_bridge.dial.console_address import ConsoleAddress
from lockstep.robot_bridge.dial.console_key import load_key, read_key_file, save_key
from lockstep.robot_bridge.errors import DiallingMissing, NotPaired

__all__ = ["choose_access"]

_logger = logging.getLogger(__name__)


def choose_access(
    console: str | None,
    code: str | None,
    key_file: Path | None,
    authority: Path | None,
    directory: Path,
    robot: str,
) -> ConsoleAccess | None:
    """Return the console that the flags mean; None: the robot dials none. Pairs first if there is a code.

    Args:
        code: as a person typed it; "-": read it from standard input
        directory: of the robot's state
        robot: its name, for people

    Raises:
        BadConsoleAddress, NotPaired, PairingRefused, ConsoleRefused, ConsoleUnreachable, WrongConsole: with what to do
        DiallingMissing: this Python has no `websockets`, as that of a ROS installation.
        SecretError: a file, or the code, cannot be used.
    """
    if console is None:
        if code is not None or key_file is not None or authority is not None:
            raise NotPaired("--pair, --console-key-file and --console-ca need --console wss://…, the console's address")
        return None
    if importlib.util.find_spec("websockets") is None:
        raise DiallingMissing("--console needs the Python package websockets; install it for this interpreter")
    address = ConsoleAddress.parse(console)
    if key_file is not None:
        return ConsoleAccess(address, read_key_file(key_file), authority)
    kept = None
    if code is None:
        kept = load_key(directory)
        if kept is None:
            raise NotPaired(
                f"this robot has no key for {address.url}: a supervisor presses “Pair a robot” on the console's page,"
                " which shows the code for --pair; or give --console-key-file"
            )
        return ConsoleAccess(address, kept, authority)
    from lockstep.robot_bridge.dial.pairing import code_digest, pair  # imports websockets

    wanted = PairingCode.parse(sys.stdin.readline() if code == "-" else code)
    try:
        kept = load_key(directory)
    except NotPaired as error:
        _logger.warning("%s", error.detail)
    if kept is not None and kept.code == code_digest(wanted):
        _logger.info("paired with this code before; it is not needed any more")
        return ConsoleAccess(address, kept, authority)
    made = asyncio.run(pair(address, wanted, robot, authority))
    save_key(directory, made)
    _logger.info("paired with the console at %s", address.url)
    return ConsoleAccess(address, made, authority)
