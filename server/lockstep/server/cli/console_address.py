"""The address of a state directory's console, for commands that run beside it."""

import msgspec

from lockstep.server.util.state_dir import StateDir

__all__ = ["read_address", "write_address"]

FILE = "console.json"


class _Address(msgspec.Struct, frozen=True):
    url: str


_decoder = msgspec.json.Decoder(_Address)


def write_address(directory: StateDir, url: str) -> None:
    """Write the address. The console that started last is the one that is found."""
    directory.write(FILE, msgspec.json.encode(_Address(url)))


def read_address(directory: StateDir) -> str:
    """Return the address; "" when no console has run with this directory."""
    data = directory.read(FILE)
    try:
        return "" if data is None else _decoder.decode(data).url
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return ""
