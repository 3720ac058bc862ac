"""The name of a console at a robot bridge: the same after a restart, and different for each console."""

import hashlib
import socket
from pathlib import Path

from lockstep.server.util.state_dir import default_state_dir

__all__ = ["console_name"]


def console_name(state_dir: Path | None) -> str:
    """Return the name, made of the machine and the state directory: "console at control-room (3fa9c1)"."""
    place = str((state_dir or default_state_dir()).absolute())
    return f"console at {socket.gethostname()[:64]} ({hashlib.sha256(place.encode()).hexdigest()[:6]})"
