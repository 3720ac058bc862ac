"""A full ICE agent (RFC 8445) for one data stream of one component, as BUNDLE and RTCP multiplexing make it."""

from collections import Counter
from collections.abc import Iterable
from random import Random, SystemRandom

from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.ice.candidates import Candidate
from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.ice.credentials import Credentials
from lockstep.rtc.ice.directory import Directory, Entries
from lockstep.rtc.ice.events import Answered, Ended, Event, PathChanged
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.sessions import Sessions
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
        self.local_candidates = tuple(local_candidates)[: self._settings.max_local_candidates]
        self.counts: Counter[str] = Counter()  # dropped datagrams, by reason
        # Requests from paths that it has not claimed; `Port` asks before it passes one on.
        self.unclaimed = TokenBucket(self._settings.max_checks_per_second, self._settings.check_burst)
        self._directory = directory or Directory()
        rng = rng or SystemRandom()
        self.role = Role(controlling, rng.getrandbits(64))
        entries = Entries(self._directory, self)
        self._sessions = Sessions(self.local_candidates, self.role, entries, self._settings, rng, self.counts)
        self.path: Path | None = None  # the path to send on; None: there is no path
        self._is_nominated = False  # what the last PathChanged said of `path`
        self._events: list[Event] = []
        self._out: list[Datagram] = []
        self.ended = False

    # Signalling

    @property
    def local_credentials(self) -> Credentials:
        """The credentials of the newest session."""
        return self._sessions.newest.local_credentials

    def set_remote(self, credentials: Credentials, candidates: Iterable[Candidate], now: float) -> None:
        """Take the peer's credentials and candidates for the newest session. Known credentials change nothing.

        Raises:
            RuntimeError: the peer's credentials have changed; call `restart` first.
        """
        session = self._sessions.newest
        remote = session.checks.remote_credentials
        if remote is None:
            session.set_remote(credentials, now)
        elif remote != credentials:
            raise RuntimeError("other credentials begin another session: call restart first")
        for candidate in candidates:
            self.add_remote_candidate(candidate)

    def add_remote_candidate(self, candidate: Candidate) -> None:
        """Add a remote candidate as it arrives (RFC 8838). Names and unreachable addresses are counted and ignored."""
        session = self._sessions.newest
        remote = session.checks.remote_credentials
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
            self.local_candidates = tuple(local_candidates)[: self._settings.max_local_candidates]
        return self._sessions.restart(self.local_candidates, now).local_credentials

    def cancel_restart(self) -> None:
        """Give up a restart, because the peer has refused it."""
        self._sessions.cancel_restart()

    # Datagrams

    def accepts(self, path: Path) -> bool:
        """True if data on this path are the peer's, as far as ICE can say."""
        return self._directory.owner(path) is self

    def receive_datagram(self, data: bytes, path: Path, now: float) -> None:
        """Take a STUN message (see `lockstep.rtc.demux`). Others are dropped and counted."""
        head = transaction_of(data)
        if self.ended or head is None:
            self.counts["not_stun"] += 1
        elif head[0] is Kind.INDICATION:
            self.counts["indication"] += 1  # a peer keeps its NAT's binding alive (RFC 8445 11)
        elif head[0] is Kind.REQUEST:
            session = self._sessions.of_user((username_of(data) or "").partition(":")[0])
            if session is None:
                self.counts["unknown_username"] += 1
            else:
                session.receive_request(data, path, now)
        elif (session := self._sessions.of_transaction(head[1])) is None:
            self.counts["unknown_transaction"] += 1
        else:
            session.receive_response(data, head[1], path, now)
        self._settle(now)

    def path_closed(self, path: Path, now: float) -> None:
        """Note that the TCP connection of this path has ended."""
        for session in self._sessions.all():
            session.path_closed(path, now)
        self._settle(now)

    def _settle(self, now: float) -> None:
        """Let sessions follow one another, collect their datagrams, and report changes."""
        if self.ended:
            return
        sessions = self._sessions
        answers = sessions.current.answers
        for session in sessions.all():
            self._out += session.take_datagrams()
            session.answers = []
        self._events += sessions.follow(now)
        current = sessions.current
        if current.failed and sessions.next is None:
            self._events.append(Ended("consent_expired" if current.selection.was_made else "no_path"))
            self.close()
            return
        pair = None if current.failed else current.selection.pair
        path, is_nominated = (None, False) if pair is None else (pair.path, pair.nominated)
        if path != self.path or is_nominated is not self._is_nominated:
            self.path, self._is_nominated = path, is_nominated
            self._events.append(PathChanged(path, is_nominated))
        self._events += [Answered(seconds) for seconds in answers]

    def datagrams_to_send(self) -> list[Datagram]:
        out, self._out = self._out, []
        return out

    def events(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    # Time and the end

    def timer(self) -> float | None:
        return self._sessions.timer()

    def handle_timer(self, now: float) -> None:
        """Do the due work. Hand over the sockets' datagrams first: after a pause of the whole process, answers count
        before the clock."""
        self._sessions.handle_timer(now)
        self._settle(now)

    def close(self) -> None:
        """Leave nothing behind in the directory. Nothing is sent to the peer: ICE has no message for it."""
        self._sessions.end()
        self._out.clear()
        self.path, self._is_nominated = None, False
        self.ended = True
