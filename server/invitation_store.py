"""The invitations on disk. Several processes change them: consoles, and `lockstep invite` and `revoke` beside them."""

import threading
import time
from collections.abc import Callable
from typing import TypeVar

import msgspec
import structlog

from server.invitations import Invitation, Invitations
from server.state_dir import StateDamaged, StateDir, StateDirUnusable

__all__ = ["InvitationStore"]

log = structlog.get_logger(__name__)

FILE = "invitations.json"
Result = TypeVar("Result")


class _File(msgspec.Struct, frozen=True):
    invitations: list[Invitation] = []


class InvitationStore:
    """`is_revoked` answers from memory; `refresh` brings the memory up to date, which costs one `stat`.

    Raises:
        StateDirUnusable, StateDamaged: it cannot be read, or not be understood.
    """

    def __init__(self, directory: StateDir) -> None:
        self._directory = directory
        self._busy = threading.Lock()
        self._version = directory.version(FILE)
        self._known = self._read()
        self._revoked = self._known.revoked()

    @property
    def known(self) -> Invitations:
        """Only to be looked at."""
        return self._known

    def is_revoked(self, invitation_id: str) -> bool:
        return invitation_id in self._revoked

    def update(self, change: Callable[[Invitations], Result]) -> Result:
        """Applies `change` to what is on disk now and writes it back; nothing is written when it raises."""
        with self._busy, self._directory.locked():
            known = self._read()
            result = change(known)
            known.prune(time.time())
            data = msgspec.json.format(msgspec.json.encode(_File(known.all)), indent=1)
            self._directory.write(FILE, data)
            self._take(known, self._directory.version(FILE))
        return result

    def refresh(self) -> list[Invitation]:
        """What another process has added or revoked since. While the file cannot be read, what is known stands."""
        if not self._busy.acquire(blocking=False):
            return []  # our own change is under way in a thread
        try:
            return self._refresh()
        except StateDirUnusable as error:
            log.error("the invitations cannot be read; the known ones stand", detail=str(error))
            return []
        finally:
            self._busy.release()

    def _refresh(self) -> list[Invitation]:
        version = self._directory.version(FILE)
        if version is None or version == self._version:
            return []
        self._version = version
        before = {step for each in self._known.all for step in _steps(each)}
        self._take(self._read(), version)
        return [step for each in self._known.all for step in _steps(each) if step not in before]

    def _take(self, known: Invitations, version: tuple[int, int] | None) -> None:
        self._version = version
        self._known, self._revoked = known, known.revoked()

    def _read(self) -> Invitations:
        data = self._directory.read(FILE)
        try:
            return Invitations([] if data is None else msgspec.json.decode(data, type=_File).invitations)
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            path = self._directory.path / FILE
            raise StateDamaged(path, f"not understood: {error}; who removes it removes signing.key too") from error


def _steps(invitation: Invitation) -> list[Invitation]:
    """What happened to it: it was made, and perhaps revoked."""
    made = msgspec.structs.replace(invitation, revoked_at=None)
    return [made] if invitation.revoked_at is None else [made, invitation]
