"""The key and the pin with which a robot knows its console, in a file that only its owner can read."""

import os
import re
from pathlib import Path
from typing import NamedTuple

import msgspec

from lockstep.protocol.dial_in import TRUSTED
from lockstep.protocol.errors import SecretError
from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.errors import NotPaired

__all__ = ["FILE", "ConsoleKey", "load_key", "read_key_file", "save_key"]

FILE = "console.json"  # in the robot's state directory
MAX_BYTES = 4096
_PIN = re.compile(r"sha256:[0-9a-f]{64}")


class ConsoleKey(NamedTuple):
    """One console's. `pin`: of its certificate's public key; `TRUSTED`: an authority vouches for the certificate."""

    key: LinkSecret
    pin: str = TRUSTED
    console: str = ""  # address at which it was paired, for people
    code: str = ""  # SHA-256 of the used pairing code in hex; "" without one


class _Kept(msgspec.Struct, kw_only=True):
    console: str
    key: str
    pin: str
    code: str = ""


_kept = msgspec.json.Decoder(_Kept)


def load_key(directory: Path) -> ConsoleKey | None:
    """Return what the robot was paired with; None before.

    Raises:
        NotPaired: the file is damaged.
    """
    path = directory / FILE
    try:
        with path.open("rb") as file:
            kept = _kept.decode(file.read(MAX_BYTES))
        return ConsoleKey(LinkSecret(kept.key), _checked(kept.pin), kept.console, kept.code)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.MsgspecError, SecretError, ValueError) as error:
        raise NotPaired(f"{path} cannot be read ({error}): pair the robot anew with --pair") from error


def save_key(directory: Path, key: ConsoleKey) -> None:
    """Write the file as a whole, and to the disk with its name, before the robot uses the key. Raises OSError."""
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    data = msgspec.json.encode(_Kept(console=key.console, key=key.key.reveal(), pin=key.pin, code=key.code))
    beside = directory / f"{FILE}.new"
    handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o600)
    with open(handle, "wb") as file:
        os.fchmod(file.fileno(), 0o600)
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(beside, directory / FILE)
    folder = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(folder)  # until then the new file name is not on the disk
    finally:
        os.close(folder)


def read_key_file(path: Path) -> ConsoleKey:
    """Read a key file: the key on its first line; a line `sha256:…`, if there is one, pins the console's public key.

    Raises:
        SecretError: it cannot be read, or is no such file.
    """
    try:
        with path.open(encoding="utf-8") as file:
            lines = [line.strip() for line in file.read(MAX_BYTES).splitlines() if line.strip()]
    except (OSError, UnicodeError) as error:
        raise SecretError(f"cannot read the console's key: {error}") from error
    if not 1 <= len(lines) <= 2:
        raise SecretError(f"{path}: one line with the key, and one with the console's pin if it has one")
    try:
        return ConsoleKey(LinkSecret(lines[0]), _checked(lines[1]) if len(lines) > 1 else TRUSTED)
    except ValueError as error:
        raise SecretError(f"{path}: {error}") from error


def _checked(pin: str) -> str:
    if pin != TRUSTED and _PIN.fullmatch(pin) is None:
        raise ValueError("a pin is sha256: and 64 hexadecimal digits")
    return pin
