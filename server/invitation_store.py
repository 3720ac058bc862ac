"""The invitations on disk. Several processes change them: consoles, and `lockstep invite` and `revoke` beside them."""

import threading
import time
from collections.abc import Callable, Mapping
from typing import TypeVar

import msgspec
import structlog

from server.invitations import Invitation, Invitations
from server.state_dir import StateDamaged, StateDir, StateDirUnusable

__all__ = ["InvitationStore"]

log = structlog.get_logger(__name__)

FILE = "invitations.json"
ELSEWHERE = "revoked-elsewhere.json"
MAX_ELSEWHERE = 5000  # links that other consoles revoked; those that would end first are forgotten first
Result = TypeVar("Result")


class _File(msgspec.Struct, frozen=True):
    invitations: list[Invitation] = []


class _Elsewhere(msgspec.Struct, frozen=True):
    revoked: dict[str, float] = {}  # id of a link: when it would have expired


_file = msgspec.json.Decoder(_File)
_elsewhere = msgspec.json.Decoder(_Elsewhere)


class InvitationStore:
    """`is_revoked` answers from memory; `refresh` brings the memory up to date, which costs one `stat`.

    Attributes:
        on_revoked: called, from any thread, when there may be more revoked links

    Raises:
        StateDirUnusable, StateDamaged: it cannot be read, or not be understood.
    """

    def __init__(self, directory: StateDir) -> None:
        self._directory = directory
        self._busy = threading.Lock()
        self.on_revoked: Callable[[], None] = _ignore
        self._version = directory.version(FILE)
        self._known = self._read()
        self._elsewhere = self._read_elsewhere()
        self._revoked = self._known.revoked()

    @property
    def known(self) -> Invitations:
        """Only to be looked at."""
        return self._known

    def is_revoked(self, invitation_id: str) -> bool:
        return invitation_id in self._revoked or invitation_id in self._elsewhere

    def revoked_links(self) -> dict[str, float]:
        """All that is known to be revoked, here and elsewhere, and when each would have expired."""
        here = {each.id: each.expires for each in self._known.all if each.revoked_at is not None}
        return {**self._elsewhere, **here}

    def revoked_elsewhere(self, links: Mapping[str, float]) -> bool:
        """Other consoles revoked these: `is_revoked` knows it from now on. Whether any of them is new."""
        fresh = {link: expires for link, expires in links.items() if link not in self._elsewhere}
        if fresh:
            self._elsewhere = _newest({**self._elsewhere, **fresh})
        return bool(fresh)

    def keep_revoked_elsewhere(self) -> list[Invitation]:
        """Blocks: write down what `revoked_elsewhere` was told, and end what was invited with those links."""
        with self._busy, self._directory.locked():
            known = {**self._read_elsewhere(), **self._elsewhere}
            kept = _newest({link: expires for link, expires in known.items() if expires > time.time()})
            self._directory.write(ELSEWHERE, msgspec.json.encode(_Elsewhere(kept)))
        if all(each.by_link not in kept or each.revoked_at is not None for each in self._known.all):
            return []
        return self.update(lambda invitations: _end_those_of(invitations, kept))

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
        before, self._known, self._revoked = self._revoked, known, known.revoked()
        if self._revoked - before:
            self.on_revoked()

    def _read(self) -> Invitations:
        data = self._directory.read(FILE)
        try:
            return Invitations([] if data is None else _file.decode(data).invitations)
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            path = self._directory.path / FILE
            raise StateDamaged(path, f"not understood: {error}; who removes it removes signing.key too") from error

    def _read_elsewhere(self) -> dict[str, float]:
        data = self._directory.read(ELSEWHERE)
        try:
            return {} if data is None else _elsewhere.decode(data).revoked
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise StateDamaged(self._directory.path / ELSEWHERE, f"not understood: {error}") from error


def _end_those_of(invitations: Invitations, links: Mapping[str, float]) -> list[Invitation]:
    """Revoke what was invited with `links`."""
    now = time.time()
    ours = [each.id for each in invitations.all if each.by_link in links and each.revoked_at is None]
    return [ended for link in ours for ended in invitations.revoke(None, link, now)]


def _newest(links: dict[str, float]) -> dict[str, float]:
    return dict(sorted(links.items(), key=lambda item: item[1], reverse=True)[:MAX_ELSEWHERE])


def _ignore() -> None:
    pass


def _steps(invitation: Invitation) -> list[Invitation]:
    """What happened to it: it was made, and perhaps revoked."""
    made = msgspec.structs.replace(invitation, revoked_at=None)
    return [made] if invitation.revoked_at is None else [made, invitation]
