"""Remembers the addresses from which a link was admitted, also over a restart.

Their TLS handshakes do not wait for those of other addresses.
"""

import os
from contextlib import suppress
from pathlib import Path

from lockstep.robot_bridge.link.admission.address_group import address_group

__all__ = ["KnownAddresses"]

LIMIT = 64  # newest addresses kept
MAX_BYTES = 8192  # of the file


class KnownAddresses:
    """A set of addresses, kept in a file.

    `read` and `write` block, and raise nothing: without the file a console waits longer after a restart.
    """

    def __init__(self, path: Path | None) -> None:
        """`path`: a file with a line for each address, the newest last; None: they are forgotten with this object."""
        self._path = path
        self._groups: dict[str, None] = {}  # oldest first

    def __contains__(self, address: str) -> bool:
        return (address_group(address) or address) in self._groups

    def add(self, address: str) -> bool:
        """Add an address. True if it was not known."""
        group = address_group(address) or address
        is_new = group not in self._groups
        self._groups.pop(group, None)
        self._groups[group] = None
        if len(self._groups) > LIMIT:
            del self._groups[next(iter(self._groups))]
        return is_new

    def read(self) -> None:
        if self._path is None:
            return
        with suppress(OSError), self._path.open("rb") as file:
            for line in file.read(MAX_BYTES).decode(errors="replace").split():
                self.add(line)

    def write(self) -> None:
        if self._path is None:
            return
        fresh = self._path.with_suffix(".new")
        with suppress(OSError):
            fresh.unlink(missing_ok=True)
            descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
            with open(descriptor, "w", encoding="utf-8") as file:
                file.write("".join(f"{each}\n" for each in list(self._groups)))
            os.replace(fresh, self._path)
