"""Revocations that the list of invitations could not take, as on a full disk."""

from collections.abc import Set as AbstractSet
from contextlib import suppress

from lockstep.server.auth.directory_lock import DirectoryLock
from lockstep.server.util.state_dir import StateDir, StateDirUnusable

__all__ = ["UnwrittenRevocations"]

ASIDE = "revoked-lately"
ASIDE_BYTES = 4096  # ids of links, one a line


class UnwrittenRevocations:
    """The ids of revoked links that are still to be written to the list. It is true if there are any.

    They are noted in a file whose room on the disk was set aside before: for the next start, and for other processes.
    """

    def __init__(self, directory: StateDir, lock: DirectoryLock) -> None:
        self._directory = directory
        self._lock = lock
        self._links: set[str] = set()
        self._version: tuple[int, int] | None = None  # of the file, when it was read

    def __bool__(self) -> bool:
        return bool(self._links)

    @property
    def links(self) -> frozenset[str]:
        return frozenset(self._links)

    def add(self, link: str) -> None:
        """Note, in memory, that the revocation of this link could not be written."""
        self._links.add(link)

    def look(self) -> set[str]:
        """Add those that an earlier run, or another process, has noted since the last call; return them."""
        version = self._directory.version(ASIDE)
        if version == self._version:
            return set()
        self._version = version
        found = self._read()
        self._links |= found
        return found

    def reserve(self) -> None:
        """Set room on the disk aside. Blocks."""
        with self._lock.held():
            self._directory.set_aside(ASIDE, ASIDE_BYTES)

    def note(self) -> None:
        """Write them to the file. Blocks.

        Raises:
            StateDirUnusable: no room was set aside, or too little.
        """
        with self._lock.held():
            self._write(self._read() | self._links)

    def written(self, links: AbstractSet[str]) -> None:
        """Forget `links`, which are in the list by now. Blocks."""
        self._links -= links
        with self._lock.held(), suppress(StateDirUnusable):  # a link noted there for longer has ended anyway
            self._write(self._read() - links)

    def _write(self, links: AbstractSet[str]) -> None:
        lines = "".join(f"{each}\n" for each in sorted(links)).encode()
        if len(lines) > ASIDE_BYTES:
            raise StateDirUnusable(self._directory.path / ASIDE, "too many links were revoked while the disk was full")
        self._directory.overwrite(ASIDE, lines.ljust(ASIDE_BYTES, b"\n"))

    def _read(self) -> set[str]:
        return set((self._directory.read(ASIDE) or b"").replace(b"\0", b"").decode(errors="replace").split())
