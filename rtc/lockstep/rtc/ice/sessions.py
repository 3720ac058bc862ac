"""How the sessions of one agent follow one another (RFC 8445 9)."""

from collections import Counter
from collections.abc import Iterable
from random import Random

from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.ice.credentials import new_credentials
from lockstep.rtc.ice.directory import Entries
from lockstep.rtc.ice.events import Event, Restarted, RestartFailed
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.session.session import Session
from lockstep.rtc.ice.settings import IceSettings

__all__ = ["Sessions"]


class Sessions:
    """`current` carries the data. `next`: the session of a restart, which takes over when it has found a path. The one
    before is still heard for a while, since datagrams are under way there."""

    def __init__(
        self,
        candidates: Iterable[LocalCandidate],
        role: Role,
        entries: Entries,
        settings: IceSettings,
        rng: Random,
        counts: Counter[str],
    ) -> None:
        self._role = role
        self._entries = entries
        self._settings = settings
        self._rng = rng
        self._counts = counts
        self.current = self._new(candidates)
        self.next: Session | None = None
        self._retired: tuple[Session, float] | None = None  # session before the last restart, and its end
        self._ended = False

    def _new(self, candidates: Iterable[LocalCandidate]) -> Session:
        credentials = new_credentials(self._rng.randbytes)
        return Session(credentials, candidates, self._role, self._entries, self._settings, self._rng, self._counts)

    @property
    def newest(self) -> Session:
        return self.next or self.current

    def all(self) -> list[Session]:
        """Return the sessions that may be heard; none after the end."""
        sessions = [] if self._ended else [self.current]
        if self.next is not None:
            sessions.append(self.next)
        if self._retired is not None:
            sessions.append(self._retired[0])
        return sessions

    def of_user(self, ufrag: str) -> Session | None:
        """Return the session that a check asks."""
        return next((each for each in self.all() if each.local_credentials.ufrag == ufrag), None)

    def of_transaction(self, transaction: bytes) -> Session | None:
        """Return the session that waits for this answer."""
        return next((each for each in self.all() if transaction in each.checks.transactions), None)

    def restart(self, candidates: Iterable[LocalCandidate], now: float) -> Session:
        """Begin another session, in place of an unfinished one."""
        self.cancel_restart()
        self.next = self._new(candidates)
        self.next.wait_for_remote(now)
        return self.next

    def cancel_restart(self) -> None:
        if self.next is not None:
            self.next.end()
            self.next = None

    def follow(self, now: float) -> list[Event]:
        """Let the next session take over when it can, or give it up. Return what has happened."""
        following = self.next
        if following is None:
            return []
        selection = following.selection
        if selection.is_nominated or (self.current.failed and selection.pair is not None):
            if self._retired is not None:
                self._retired[0].end()
            self.current.retire()
            self._retired = (self.current, now + self._settings.retired_seconds)
            self.current, self.next = following, None
            return [Restarted()]
        if following.failed:
            self.cancel_restart()
            return [RestartFailed()]
        return []

    def timer(self) -> float | None:
        times = [session.timer() for session in self.all()]
        if self._retired is not None:
            times.append(self._retired[1])
        return min((each for each in times if each is not None), default=None)

    def handle_timer(self, now: float) -> None:
        if self._retired is not None and now >= self._retired[1]:
            self._retired[0].end()
            self._retired = None
        for session in self.all():
            session.handle_timer(now)

    def end(self) -> None:
        """Leave nothing behind in the directory. Idempotent."""
        for session in self.all():
            session.end()
        self._retired = self.next = None
        self._ended = True
