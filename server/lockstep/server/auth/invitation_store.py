"""The invitations on disk. Several processes change them: consoles, `lockstep invite` and `lockstep revoke`."""

from collections.abc import Callable, Collection, Mapping
from typing import TypeVar

import msgspec
import structlog

from lockstep.server.auth.directory_lock import DirectoryLock
from lockstep.server.auth.invitations import Invitation, Invitations
from lockstep.server.auth.revoked_elsewhere import RevokedElsewhere
from lockstep.server.auth.stored_clock import SEEN, StoredClock
from lockstep.server.auth.tokens import Identity
from lockstep.server.auth.unwritten_revocations import UnwrittenRevocations
from lockstep.server.errors import LinkExpired, LinkRevoked, NotFound
from lockstep.server.util.state_dir import StateDamaged, StateDir, StateDirUnusable

__all__ = ["InvitationStore"]

log = structlog.get_logger(__name__)

FILE = "invitations.json"
REPAIR = f"restore it, or remove signing.key and {SEEN} too, which ends all links"
HANGS_AFTER = 10.0  # s that a change may take; then it is unknown what other processes have revoked meanwhile
Result = TypeVar("Result")


class _File(msgspec.Struct, frozen=True):
    invitations: list[Invitation] = []


_file = msgspec.json.Decoder(_File)


class InvitationStore:
    """The stored invitations. `is_revoked` answers from memory; `refresh` updates the memory, which costs one `stat`.

    An expired link is removed only after the time by which it had ended is on disk: a clock that is wrong later cannot
    revive it.

    Attributes:
        known: the invitations in memory; not to be changed
        clock: by which links end
        unwritten: revocations that are not in the list on disk yet
        on_revoked: called, from any thread, when there may be more revoked links
        trouble: the reason if the list cannot be read at present, so that revocations are unknown; else ""

    Raises:
        StateDirUnusable, StateDamaged: it cannot be read or decoded.
    """

    def __init__(self, directory: StateDir) -> None:
        self._directory = directory
        self._lock = DirectoryLock(directory)
        self.on_revoked: Callable[[], None] = _ignore
        self.trouble = ""
        self.clock = StoredClock(directory, beside=FILE)
        self._version = directory.version(FILE)
        if self._version is None and self.clock.began_at:
            raise StateDamaged(directory.path / FILE, f"the file is missing; {REPAIR}")
        self.known = _read(directory)
        self._elsewhere = RevokedElsewhere(directory)
        self._revoked = self.known.revoked()
        self._ended: set[str] = set()  # revoked by this process, whether or not on disk
        self.unwritten = UnwrittenRevocations(directory, self._lock)
        for link in self.unwritten.look():
            self.end_at_once(None, link)

    def check(self, identity: Identity, known: Invitations) -> None:
        """Raise LinkExpired or LinkRevoked if the link of `identity` has ended; call within a change of `known`."""
        if identity.expires <= self.clock.now():
            raise LinkExpired("this link has expired; ask for a new one")
        if self.is_revoked(identity.token_id) or identity.token_id in known.revoked():
            raise LinkRevoked("this link was revoked")

    def keep_time(self) -> None:
        """Write the time to disk, for the next run. Blocks."""
        with self._lock.held():
            self.clock.write()
        self.unwritten.reserve()

    def is_revoked(self, invitation_id: str) -> bool:
        return invitation_id in self._revoked or invitation_id in self._elsewhere or invitation_id in self._ended

    def invited_with(self, link: str) -> str:
        """Return the link that this one was made with; "" if it was made without one, or is unknown here."""
        return self.known.invited_with(link)

    def end_at_once(self, by: Identity | None, invitation_id: str) -> bool:
        """Revoke this link, and all that was invited with it, in memory, without waiting for the disk.

        False if it is unknown here; a link that another process has just made is found by `update` alone.
        """
        try:
            ended = Invitations(self.known.all).revoke(by, invitation_id, self.clock.now())
        except NotFound:
            return False
        self._ended |= {each.id for each in ended}
        return True

    def keep_ended(self) -> list[Invitation]:
        """Write the unwritten revocations; return the invitations that this changed. Blocks."""
        wanted = self.unwritten.links
        ended = self.update(lambda invitations: _end(invitations, wanted, self.clock.now()))
        self.unwritten.written(wanted)
        return ended

    def has_ended(self, link: str, expires: float) -> bool:
        """True if the link of this id, which expires at `expires`, is no longer good."""
        return self.is_revoked(link) or self.clock.now() >= expires

    def revoked_links(self) -> dict[str, float]:
        """Return all links known to be revoked, here and elsewhere, and when each would have expired."""
        here = {each.id: each.expires for each in self.known.all if each.revoked_at is not None}
        return {**self._elsewhere.links, **here}

    def revoked_elsewhere(self, links: Mapping[str, float]) -> bool:
        """Add links that other consoles revoked, for `is_revoked`; True if any of them is new."""
        return self._elsewhere.add(links)

    def keep_revoked_elsewhere(self) -> list[Invitation]:
        """Write the links passed to `revoked_elsewhere`, and revoke what was invited with them. Blocks."""
        with self._lock.held():
            now = self.clock.write()
            kept = self._elsewhere.write(now)
        if all(each.by_link not in kept or each.revoked_at is not None for each in self.known.all):
            return []
        return self.update(lambda invitations: _end_those_of(invitations, kept, now))

    def update(self, change: Callable[[Invitations], Result]) -> Result:
        """Apply `change` to the invitations on disk and write them back; nothing is written if it raises."""
        with self._lock.held():
            known = _read(self._directory, must_exist=self._version is not None)
            result = change(known)
            known.prune(self.clock.write())
            data = msgspec.json.format(msgspec.json.encode(_File(known.all)), indent=1)
            self._directory.write(FILE, data)
            self._take(known, self._directory.version(FILE))
        return result

    def refresh(self) -> list[Invitation]:
        """Return what another process has added or revoked since. If the list cannot be read, `trouble` says why."""
        with self._lock.unless_held() as is_free:
            if not is_free:  # a change is under way in a thread of this process
                if self._lock.seconds_held > HANGS_AFTER:
                    self._tell_trouble("the disk does not answer", "a change of the list of links does not finish")
                return []
            try:
                for link in self.unwritten.look():
                    self.end_at_once(None, link)
                version = self._directory.version(FILE)
                if version == self._version and not self.trouble:
                    return []
                known = _read(self._directory, must_exist=self._version is not None)
            except StateDirUnusable as error:
                self._tell_trouble(error.reason, str(error))
                return []
            before = {step for each in self.known.all for step in _steps(each)}
            self._take(known, version)
        if self.trouble:
            log.warning("the list of revoked links can be read again")
            self.trouble = ""
        return [step for each in known.all for step in _steps(each) if step not in before]

    def _tell_trouble(self, reason: str, detail: str) -> None:
        if reason != self.trouble:
            log.error("the list of revoked links cannot be read; the console admits no one", detail=detail)
        self.trouble = reason

    def _take(self, known: Invitations, version: tuple[int, int] | None) -> None:
        self._version = version
        before, self.known, self._revoked = self._revoked, known, known.revoked()
        if self._revoked - before:
            self.on_revoked()


def _read(directory: StateDir, *, must_exist: bool = False) -> Invitations:
    """Read the invitations. Raises StateDamaged if they cannot be decoded, or there are none but `must_exist`."""
    if must_exist and directory.version(FILE) is None:
        raise StateDamaged(directory.path / FILE, "the file is missing")
    data = directory.read(FILE)
    try:
        return Invitations([] if data is None else _file.decode(data).invitations)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise StateDamaged(directory.path / FILE, f"the file is damaged ({error}); {REPAIR}") from error


def _end_those_of(invitations: Invitations, links: Mapping[str, float], now: float) -> list[Invitation]:
    """Revoke what was invited with `links`."""
    ours = [each.id for each in invitations.all if each.by_link in links and each.revoked_at is None]
    return [ended for link in ours for ended in invitations.revoke(None, link, now)]


def _end(invitations: Invitations, links: Collection[str], now: float) -> list[Invitation]:
    """Revoke `links` themselves."""
    ours = [each.id for each in invitations.all if each.id in links and each.revoked_at is None]
    return [ended for link in ours for ended in invitations.revoke(None, link, now)]


def _ignore() -> None:
    pass


def _steps(invitation: Invitation) -> list[Invitation]:
    """Return the steps of an invitation: it was made, and perhaps revoked."""
    made = msgspec.structs.replace(invitation, revoked_at=None)
    return [made] if invitation.revoked_at is None else [made, invitation]
