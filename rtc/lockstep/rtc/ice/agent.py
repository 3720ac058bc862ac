"""A full ICE agent (RFC 8445) for one data stream of one component, as BUNDLE and RTCP multiplexing make it."""

from collections import Counter
from collections.abc import Iterable
from random import Random, SystemRandom

from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.ice.candidates import Candidate
from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.ice.credentials import Credentials, new_credentials
from lockstep.rtc.ice.directory import Directory
from lockstep.rtc.ice.events import Answered, Ended, Event, PathChanged, Restarted, RestartFailed
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.session import Session
from lockstep.rtc.ice.settings import IceSettings
from lockstep.rtc.stun import Kind, transaction_of, username_of
from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["Agent"]


class Agent:
    """Finds a path to the peer and keeps it; opens no socket, and gets the time from its caller.

    Signalling carries `local_credentials` and `local_candidates` to the peer, and the peer's to `set_remote`. Then the
    agent lives by `receive_datagram` and `handle_timer`; drain `datagrams_to_send` and `events` after each. Send on
    `path`. A restart is `restart` and then `set_remote`; the path stays until the new session has nominated one. An
    agent without a message from its peer waits without end: its owner bounds that.

    Args:
        local_candidates: The addresses for the peer, and those that datagrams leave from.
        controlling: True if this agent decides on the path: the one whose offer began the session does, unless the
            peer is a lite agent. If both believe it, tie-breakers settle that.
        directory: Shared by agents that share sockets.
        rng: Makes credentials and transactions, which nobody may foresee: a `SystemRandom` except in tests.
    """

    def __init__(
        self,
        local_candidates: Iterable[LocalCandidate],
        *,
        controlling: bool,
        settings: IceSettings | None = None,
        directory: Directory | None = None,
        rng: Random | None = None,
    ) -> None:
        self._settings = settings or IceSettings()
        self.local_candidates: tuple[LocalCandidate, ...] = ()
        self._set_candidates(local_candidates)
        self.counts: Counter[str] = Counter()  # dropped datagrams, by reason
        # Requests from paths that it has not claimed; `Port` asks before it passes one on.
        self.unclaimed = TokenBucket(self._settings.max_checks_per_second, self._settings.check_burst)
        self._directory = directory or Directory()
        self._rng = rng or SystemRandom()
        self._role = Role(controlling, self._rng.getrandbits(64))
        self._current = self._new_session()
        self._next: Session | None = None  # the session of a restart
        self._retired: tuple[Session, float] | None = None  # session before the last restart, and its end
        self._told: tuple[Path | None, bool] = (None, False)  # path and nomination of the last PathChanged
        self._events: list[Event] = []
        self._answered: list[Event] = []  # events that follow the news of a path
        self._out: list[Datagram] = []
        self.ended = False

    # Signalling

    @property
    def local_credentials(self) -> Credentials:
        """The credentials of the newest session."""
        return (self._next or self._current).local_credentials

    @property
    def controlling(self) -> bool:
        return self._role.controlling

    def set_remote(self, credentials: Credentials, candidates: Iterable[Candidate], now: float) -> None:
        """Take the peer's credentials and candidates for the newest session. Known credentials change nothing.

        Raises:
            RuntimeError: the peer's credentials have changed; call `restart` first.
        """
        session = self._next or self._current
        if session.remote_credentials is None:
            session.set_remote(credentials, now)
        elif session.remote_credentials != credentials:
            raise RuntimeError("other credentials begin another session: call restart first")
        for candidate in candidates:
            self.add_remote_candidate(candidate)

    def add_remote_candidate(self, candidate: Candidate) -> None:
        """Add a remote candidate as it arrives (RFC 8838). Names and unreachable addresses are counted and ignored."""
        session = self._next or self._current
        remote = session.remote_credentials
        if remote is not None and candidate.ufrag not in (None, remote.ufrag):
            self.counts["candidate_of_another_session"] += 1
        elif candidate.component != 1:
            self.counts["candidate_of_another_component"] += 1
        elif not candidate.is_ip_address:
            self.counts["candidate_with_a_name"] += 1  # the peer's checks show its address
        elif not candidate.can_be_sent_to:
            self.counts["candidate_unreachable"] += 1
        else:
            session.add_remote_candidate(candidate)

    def restart(self, now: float, local_candidates: Iterable[LocalCandidate] | None = None) -> Credentials:
        """Begin another session (RFC 8445 9), in place of an unfinished one; return the credentials to signal.

        `Restarted` or `RestartFailed` follows. `local_candidates`: the addresses for the peer from now on, as after a
        change of the network; None: as before.
        """
        if local_candidates is not None:
            self._set_candidates(local_candidates)
        if self._next is not None:
            self._next.end()
        self._next = self._new_session()
        self._next.wait_for_remote(now)
        return self._next.local_credentials

    def cancel_restart(self) -> None:
        """Give up a restart, because the peer has refused it."""
        if self._next is not None:
            self._next.end()
            self._next = None

    # Datagrams

    @property
    def path(self) -> Path | None:
        """The path to send on; None: there is no path."""
        return self._told[0]

    @property
    def rtt(self) -> float | None:
        """The shortest round trip that the session has measured, in s; None before the first."""
        return self._current.rtt

    def accepts(self, path: Path) -> bool:
        """True if data on this path are the peer's, as far as ICE can say."""
        return self._directory.owner(path) is self

    def receive_datagram(self, data: bytes, path: Path, now: float) -> None:
        """Take a STUN message (see `lockstep.rtc.demux`). Others are dropped and counted."""
        head = transaction_of(data)
        if self.ended or head is None:
            self.counts["not_stun"] += 1
        elif head[0] is Kind.REQUEST:
            self._receive_request(data, path, now)
        elif head[0] is Kind.INDICATION:
            self.counts["indication"] += 1  # a peer keeps its NAT's binding alive (RFC 8445 11)
        else:
            self._receive_response(data, head[1], path, now)
        self._settle(now)

    def datagrams_to_send(self) -> list[Datagram]:
        out, self._out = self._out, []
        return out

    def path_closed(self, path: Path, now: float) -> None:
        """Note that the TCP connection of this path has ended."""
        for session in self._sessions():
            session.path_closed(path, now)
        self._settle(now)

    # Time

    def timer(self) -> float | None:
        times = [session.timer() for session in self._sessions()]
        if self._retired is not None:
            times.append(self._retired[1])
        return min((each for each in times if each is not None), default=None)

    def handle_timer(self, now: float) -> None:
        """Do the due work. Hand over the sockets' datagrams first: after a pause of the whole process, answers count
        before the clock."""
        if self._retired is not None and now >= self._retired[1]:
            self._retired[0].end()
            self._retired = None
        for session in self._sessions():
            session.handle_timer(now)
        self._settle(now)

    def events(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    def close(self) -> None:
        """Leave nothing behind in the directory. Nothing is sent to the peer: ICE has no message for it."""
        for session in self._sessions():
            session.end()
        self._retired = self._next = None
        self._out.clear()
        self._told = (None, False)
        self.ended = True

    def release(self, path: Path) -> None:
        """Note, for a session, that it has given up a path. The agent keeps a path that another session has."""
        if not any(session.has_heard(path) for session in self._sessions()):
            self._directory.release(path, self)

    def answered(self, session: Session, seconds: float) -> None:
        """Note, for a session, that a check on the path in use was answered after `seconds`."""
        if session is self._current:
            self._answered.append(Answered(seconds))

    # Inside

    def _set_candidates(self, candidates: Iterable[LocalCandidate]) -> None:
        self.local_candidates = tuple(candidates)[: self._settings.max_local_candidates]

    def _new_session(self) -> Session:
        return Session(
            self,
            new_credentials(self._rng.randbytes),
            self.local_candidates,
            self._role,
            self._directory,
            self._settings,
            self._rng,
            self.counts,
        )

    def _sessions(self) -> list[Session]:
        sessions = [] if self.ended else [self._current]
        if self._next is not None:
            sessions.append(self._next)
        if self._retired is not None:
            sessions.append(self._retired[0])
        return sessions

    def _receive_request(self, data: bytes, path: Path, now: float) -> None:
        asked = (username_of(data) or "").partition(":")[0]
        for session in self._sessions():
            if session.local_credentials.ufrag == asked:
                session.receive_request(data, path, now)
                return
        self.counts["unknown_username"] += 1

    def _receive_response(self, data: bytes, transaction: bytes, path: Path, now: float) -> None:
        for session in self._sessions():
            if session.has_asked(transaction):
                session.receive_response(data, transaction, path, now)
                return
        self.counts["unknown_transaction"] += 1

    def _settle(self, now: float) -> None:
        """Let sessions follow one another, collect their datagrams, and report changes."""
        if self.ended:
            return
        for session in self._sessions():
            self._out += session.take_datagrams()
        if self._next is not None and (
            self._next.is_nominated or (self._current.failed and self._next.selected is not None)
        ):
            self._take_over(self._next, now)
        elif self._next is not None and self._next.failed:
            self._next.end()
            self._next = None
            self._events.append(RestartFailed())
        if self._current.failed and self._next is None:
            self._events.append(Ended("consent_expired" if self._current.was_connected else "no_path"))
            self.close()
        else:
            self._tell_path()

    def _take_over(self, session: Session, now: float) -> None:
        if self._retired is not None:
            self._retired[0].end()
        self._current.retire()
        self._retired = (self._current, now + self._settings.retired_seconds)
        self._current, self._next = session, None
        self._events.append(Restarted())

    def _tell_path(self) -> None:
        selected = None if self._current.failed else self._current.selected
        path, nominated = (None, False) if selected is None else (selected.path, selected.nominated)
        if (path, nominated) != self._told:
            self._told = (path, nominated)
            self._events.append(PathChanged(path, nominated))
        self._events += self._answered
        self._answered.clear()
