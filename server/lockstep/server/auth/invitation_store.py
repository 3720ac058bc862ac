"""The invitations on disk. Several processes change them: consoles, `lockstep invite` and `lockstep revoke`."""

import math
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import TypeVar

import msgspec
import structlog

from lockstep.server.auth.invitation_clock import LinkClock
from lockstep.server.auth.invitations import Invitation, Invitations
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import LinkExpired, LinkRevoked, NotFound
from lockstep.server.util.state_dir import StateDamaged, StateDir, StateDirUnusable

__all__ = ["InvitationStore"]

log = structlog.get_logger(__name__)

FILE = "invitations.json"
ELSEWHERE = "revoked-elsewhere.json"
SEEN = "newest-time.json"
ASIDE = "revoked-lately"
ASIDE_BYTES = 4096  # ids of links, one a line
BEHIND_SECONDS = 60.0  # that a clock may be behind the newest time without a warning
REPAIR = f"restore it, or remove signing.key and {SEEN} too, which ends all links"
HANGS_AFTER = 10.0  # s that a change may take; then it is unknown what other processes have revoked meanwhile
MAX_ELSEWHERE = 5000  # links that other consoles revoked; those that would end first are forgotten first
Result = TypeVar("Result")


class _File(msgspec.Struct, frozen=True):
    invitations: list[Invitation] = []


class _Elsewhere(msgspec.Struct, frozen=True):
    revoked: dict[str, float] = {}  # id of a link: when it would have expired


class _Seen(msgspec.Struct, frozen=True):
    seen: float  # s since 1970: the newest time that any process saw


_file = msgspec.json.Decoder(_File)
_elsewhere = msgspec.json.Decoder(_Elsewhere)
_seen = msgspec.json.Decoder(_Seen)


class InvitationStore:
    """The stored invitations. `is_revoked` answers from memory; `refresh` updates the memory, which costs one `stat`.

    An expired link is removed only after the time by which it had ended is on disk: a clock that is wrong later cannot
    revive it.

    Attributes:
        on_revoked: called, from any thread, when there may be more revoked links
        trouble: the reason if the list cannot be read at present, so that revocations are unknown; else ""

    Raises:
        StateDirUnusable, StateDamaged: it cannot be read or decoded.
    """

    def __init__(self, directory: StateDir) -> None:
        self._directory = directory
        self._busy = threading.Lock()
        self._busy_since = math.inf  # s, when `_busy` was taken
        self.on_revoked: Callable[[], None] = _ignore
        self.trouble = ""
        seen = self._read_seen()
        self._clock = LinkClock(seen, _steady())
        self._version = directory.version(FILE)
        if self._version is None and seen:
            raise StateDamaged(directory.path / FILE, f"the file is missing; {REPAIR}")
        self._known = self._read()
        self._elsewhere = self._read_elsewhere()
        self._revoked = self._known.revoked()
        self._ended: set[str] = set()  # revoked by this process, whether or not on disk
        self._unwritten: set[str] = set()  # those of them that are still to be written
        self._aside: tuple[int, int] | None = None  # version of the file that was set aside
        self._look_aside()
        if seen > time.time() + BEHIND_SECONDS:
            log.warning("this machine's clock is behind the newest recorded time; links end by that time", seen=seen)

    def now(self) -> float:
        """Return the time by which links end, s since 1970; it never runs backwards."""
        return self._clock.at(time.time(), _steady())

    def check(self, identity: Identity, known: Invitations) -> None:
        """Raise LinkExpired or LinkRevoked if the link of `identity` has ended; call within a change of `known`."""
        if identity.expires <= self.now():
            raise LinkExpired("this link has expired; ask for a new one")
        if self.is_revoked(identity.token_id) or identity.token_id in known.revoked():
            raise LinkRevoked("this link was revoked")

    def keep_time(self) -> None:
        """Write the time to disk, for the next run. Blocks."""
        with self._alone():
            self._write_seen()
            self._directory.set_aside(ASIDE, ASIDE_BYTES)

    @property
    def known(self) -> Invitations:
        """The invitations in memory; not to be changed."""
        return self._known

    def is_revoked(self, invitation_id: str) -> bool:
        return invitation_id in self._revoked or invitation_id in self._elsewhere or invitation_id in self._ended

    def invited_with(self, link: str) -> str:
        """Return the link that this one was made with; "" if it was made without one, or is unknown here."""
        return self._known.invited_with(link)

    def end_at_once(self, by: Identity, invitation_id: str) -> bool:
        """Revoke this link, and all that was invited with it, in memory, without waiting for the disk.

        False if it is unknown here; a link that another process has just made is found by `update` alone.
        """
        return self._end_here(invitation_id, by)

    def _end_here(self, invitation_id: str, by: Identity | None) -> bool:
        try:
            ended = Invitations(self._known.all).revoke(by, invitation_id, self.now())
        except NotFound:
            return False
        self._ended |= {each.id for each in ended}
        return True

    def write_later(self, invitation_id: str) -> None:
        """Note that the revocation of this link could not be written: `keep_ended` is to try again."""
        self._unwritten.add(invitation_id)

    def note_ended(self) -> None:
        """Write the unwritten revocations to the file that was set aside for them, for the next start. Blocks."""
        with self._alone():
            self._write_aside(self._read_aside() | self._unwritten)

    def _look_aside(self) -> None:
        """Take the revocations that an earlier run, or another process, could write nowhere else."""
        version = self._directory.version(ASIDE)
        if version != self._aside:
            self._aside = version
            for link in self._read_aside():
                self._end_here(link, None)
                self._unwritten.add(link)

    def _write_aside(self, links: Collection[str]) -> None:
        lines = "".join(f"{each}\n" for each in sorted(links)).encode()
        if len(lines) > ASIDE_BYTES:
            raise StateDirUnusable(self._directory.path / ASIDE, "too many links were revoked while the disk was full")
        self._directory.overwrite(ASIDE, lines.ljust(ASIDE_BYTES, b"\n"))

    def _read_aside(self) -> set[str]:
        return set((self._directory.read(ASIDE) or b"").replace(b"\0", b"").decode(errors="replace").split())

    @property
    def unwritten(self) -> bool:
        """True if a revocation is not on disk yet."""
        return bool(self._unwritten)

    def keep_ended(self) -> list[Invitation]:
        """Write the unwritten revocations; return the invitations that this changed. Blocks."""
        wanted = frozenset(self._unwritten)
        ended = self.update(lambda invitations: _end(invitations, wanted, self.now()))
        self._unwritten -= wanted
        with self._alone(), suppress(StateDirUnusable):  # a link noted there for longer has ended anyway
            self._write_aside(self._read_aside() - wanted)
        return ended

    def has_ended(self, link: str, expires: float) -> bool:
        """True if the link of this id, which expires at `expires`, is no longer good."""
        return self.is_revoked(link) or self.now() >= expires

    def revoked_links(self) -> dict[str, float]:
        """Return all links known to be revoked, here and elsewhere, and when each would have expired."""
        here = {each.id: each.expires for each in self._known.all if each.revoked_at is not None}
        return {**self._elsewhere, **here}

    def revoked_elsewhere(self, links: Mapping[str, float]) -> bool:
        """Add links that other consoles revoked, for `is_revoked`; True if any of them is new."""
        fresh = {link: expires for link, expires in links.items() if link not in self._elsewhere}
        if fresh:
            self._elsewhere = _newest({**self._elsewhere, **fresh})
        return bool(fresh)

    def keep_revoked_elsewhere(self) -> list[Invitation]:
        """Write the links passed to `revoked_elsewhere`, and revoke what was invited with them. Blocks."""
        with self._alone():
            known = {**self._read_elsewhere(), **self._elsewhere}
            now = self._write_seen()
            kept = _newest({link: expires for link, expires in known.items() if expires > now})
            self._directory.write(ELSEWHERE, msgspec.json.encode(_Elsewhere(kept)))
        if all(each.by_link not in kept or each.revoked_at is not None for each in self._known.all):
            return []
        return self.update(lambda invitations: _end_those_of(invitations, kept, now))

    def update(self, change: Callable[[Invitations], Result]) -> Result:
        """Apply `change` to the invitations on disk and write them back; nothing is written if it raises."""
        with self._alone():
            known = self._read_known()
            result = change(known)
            known.prune(self._write_seen())
            data = msgspec.json.format(msgspec.json.encode(_File(known.all)), indent=1)
            self._directory.write(FILE, data)
            self._take(known, self._directory.version(FILE))
        return result

    def refresh(self) -> list[Invitation]:
        """Return what another process has added or revoked since. If the list cannot be read, `trouble` says why."""
        if not self._busy.acquire(blocking=False):  # a change is under way in a thread of this process
            if _steady() - self._busy_since > HANGS_AFTER:
                self._tell_trouble("the disk does not answer", "a change of the list of links does not finish")
            return []
        try:
            found = self._refresh()
        except StateDirUnusable as error:
            self._tell_trouble(error.reason, str(error))
            return []
        finally:
            self._busy.release()
        if self.trouble:
            log.warning("the list of revoked links can be read again")
            self.trouble = ""
        return found

    def _tell_trouble(self, reason: str, detail: str) -> None:
        if reason != self.trouble:
            log.error("the list of revoked links cannot be read; the console admits no one", detail=detail)
        self.trouble = reason

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Let one thread of one process at a time inside."""
        with self._busy:
            self._busy_since = _steady()
            try:
                with self._directory.locked():
                    yield
            finally:
                self._busy_since = math.inf

    def _refresh(self) -> list[Invitation]:
        self._look_aside()
        version = self._directory.version(FILE)
        if version == self._version and not self.trouble:
            return []
        before = {step for each in self._known.all for step in _steps(each)}
        self._take(self._read_known(), version)
        return [step for each in self._known.all for step in _steps(each) if step not in before]

    def _read_known(self) -> Invitations:
        """Read the invitations. Raises StateDamaged if the file is gone that this run has seen before."""
        if self._version is not None and self._directory.version(FILE) is None:
            raise StateDamaged(self._directory.path / FILE, "the file is missing")
        return self._read()

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
            raise StateDamaged(path, f"the file is damaged ({error}); {REPAIR}") from error

    def _read_seen(self) -> float:
        data = self._directory.read(SEEN)
        try:
            return 0.0 if data is None else _seen.decode(data).seen
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise StateDamaged(self._directory.path / SEEN, f"the file is damaged: {error}") from error

    def _write_seen(self) -> float:
        """Write the time to disk and return it."""
        self._clock.saw(self._read_seen())
        now = self.now()
        if self._directory.version(FILE) is not None:  # so that a time on disk proves that there was a list
            self._directory.write(SEEN, msgspec.json.encode(_Seen(now)))
        return now

    def _read_elsewhere(self) -> dict[str, float]:
        data = self._directory.read(ELSEWHERE)
        try:
            return {} if data is None else _elsewhere.decode(data).revoked
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise StateDamaged(self._directory.path / ELSEWHERE, f"the file is damaged: {error}") from error


def _steady() -> float:
    """Return monotonic s, which count also while the machine sleeps, where the system can tell."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic()


def _end_those_of(invitations: Invitations, links: Mapping[str, float], now: float) -> list[Invitation]:
    """Revoke what was invited with `links`."""
    ours = [each.id for each in invitations.all if each.by_link in links and each.revoked_at is None]
    return [ended for link in ours for ended in invitations.revoke(None, link, now)]


def _end(invitations: Invitations, links: Collection[str], now: float) -> list[Invitation]:
    """Revoke `links` themselves."""
    ours = [each.id for each in invitations.all if each.id in links and each.revoked_at is None]
    return [ended for link in ours for ended in invitations.revoke(None, link, now)]


def _newest(links: dict[str, float]) -> dict[str, float]:
    return dict(sorted(links.items(), key=lambda item: item[1], reverse=True)[:MAX_ELSEWHERE])


def _ignore() -> None:
    pass


def _steps(invitation: Invitation) -> list[Invitation]:
    """Return the steps of an invitation: it was made, and perhaps revoked."""
    made = msgspec.structs.replace(invitation, revoked_at=None)
    return [made] if invitation.revoked_at is None else [made, invitation]
