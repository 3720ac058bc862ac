"""The command of a TURN server: coturn, with time-limited credentials and nothing but what a relay needs."""

import shutil
from pathlib import Path

__all__ = ["turn_command"]


def turn_command(folder: Path, address: str, port: int, secret: str, *further: str) -> list[str]:
    """Return the command that runs coturn until it is ended. `folder`: for its files; `further`: options of coturn.

    Raises:
        FileNotFoundError: coturn is not installed.
    """
    program = shutil.which("turnserver")
    if program is None:
        raise FileNotFoundError("coturn is not installed: Debian's package is called coturn")
    return [
        *(program, "-n", f"--listening-ip={address}", f"--relay-ip={address}", f"--listening-port={port}"),
        *("--use-auth-secret", f"--static-auth-secret={secret}", "--realm=lockstep.example", "--fingerprint"),
        *("--no-tls", "--no-dtls", "--no-cli", "--verbose"),
        *(f"--pidfile={folder / 'turn.pid'}", f"--userdb={folder / 'turn.db'}"),
        *further,
    ]
