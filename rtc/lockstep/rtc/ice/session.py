"""One ICE session (RFC 8445 6 to 8): the checks under one pair of credentials, and consent on the path they find."""

from collections import Counter, deque
from collections.abc import Iterable
from random import Random
from typing import TYPE_CHECKING

from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.ice.candidates import Candidate, TcpType, candidate_priority, foundation
from lockstep.rtc.ice.check_list import CheckList, LocalCandidate, Pair, PairState, bases
from lockstep.rtc.ice.consent import Consent
from lockstep.rtc.ice.credentials import Credentials
from lockstep.rtc.ice.directory import Directory
from lockstep.rtc.ice.remote_candidates import RemoteCandidates
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.settings import IceSettings
from lockstep.rtc.ice.transactions import Transaction
from lockstep.rtc.stun import BINDING, Kind, Message, StunError, StunErrorCode, is_authentic, parse, serialize
from lockstep.rtc.token_bucket import TokenBucket

if TYPE_CHECKING:
    from lockstep.rtc.ice.agent import Agent

__all__ = ["Session"]

ROLE_CONFLICT = 487


class Session:
    """An ICE session (RFC 8445); a restart begins another one. `Agent` owns it and passes datagrams on.

    `selected` is the pair to send on; it is set as soon as one works, and changes with nomination. `counts` has the
    dropped datagrams, by reason, and is shared with the agent.
    """

    def __init__(
        self,
        agent: "Agent",
        credentials: Credentials,
        candidates: Iterable[LocalCandidate],
        role: Role,
        directory: Directory,
        settings: IceSettings,
        rng: Random,
        counts: Counter[str],
    ) -> None:
        self.local_credentials = credentials
        self.remote_credentials: Credentials | None = None
        self.selected: Pair | None = None
        self.consent: Consent | None = None
        self.failed = False  # no path was found in time, or consent has expired
        self.was_connected = False  # a path was found
        self.rtt: float | None = None  # seconds, the shortest that was measured
        self._retired = False
        self._agent = agent
        self._role = role
        self._directory = directory
        self._settings = settings
        self._rng = rng
        self._counts = counts
        self._locals = bases(list(candidates))
        self._remotes = RemoteCandidates(settings)
        self._list = CheckList(settings.max_pairs)
        self._triggered: deque[Pair] = deque()
        self._transactions: dict[bytes, Transaction] = {}
        self._seen: dict[bytes, None] = {}  # transactions of the peer's checks, the newest last
        self._answers = TokenBucket(settings.max_checks_per_second, settings.check_burst)
        self._answers_again = TokenBucket(settings.max_checks_per_second, settings.check_burst)  # to known checks
        self._out: list[Datagram] = []
        self._next_check_at = 0.0
        self._fails_at: float | None = None
        self._nominate_at: float | None = None
        self._rival: tuple[Pair, float, float] | None = None  # nominated instead of `selected`; beginning, deadline
        directory.ufrags[credentials.ufrag] = agent

    # Methods for the agent

    def wait_for_remote(self, now: float) -> None:
        """Fail if there is no path `connect_seconds` from now."""
        self._fails_at = now + self._settings.connect_seconds

    def set_remote(self, credentials: Credentials, now: float) -> None:
        self.remote_credentials = credentials
        self.wait_for_remote(now)
        self._next_check_at = now

    def add_remote_candidate(self, candidate: Candidate) -> None:
        """Add a candidate with an IP address, that signalling names."""
        if not self._remotes.add_signalled(candidate):
            self._counts["candidate_not_added"] += 1
        elif not self.is_nominated:
            self._list.add(self._locals, candidate)
            self._drop(self._list.trim(self._role.controlling, self.selected))

    def end(self) -> None:
        """End the session, and leave nothing behind in the directory."""
        self._directory.ufrags.pop(self.local_credentials.ufrag, None)
        for transaction in list(self._transactions.values()):
            self._forget(transaction)
        paths = list(self._list.pairs)
        self._list.pairs.clear()
        self._triggered.clear()
        self.selected = self.consent = self._rival = None
        for path in paths:
            self._agent.release(path)

    def retire(self) -> None:
        """Answer checks and accept data that are under way, and ask nothing more: another session has taken over."""
        for transaction in list(self._transactions.values()):
            self._forget(transaction)
        self._triggered.clear()
        self._retired = True
        self.remote_credentials = self.consent = self._rival = self._fails_at = self._nominate_at = None

    def path_closed(self, path: Path, now: float) -> None:
        """Note that the connection of a TCP path has ended."""
        pair = self._list.pairs.pop(path, None)
        if pair is None:
            return
        self._drop([pair])
        if pair is self.selected:
            self.selected = self.consent = None
            self._fails_at = now + self._settings.consent_seconds  # time for the peer to connect again
            if (best := self._best(now)) is not None:
                self._select(best, now)

    def has_heard(self, path: Path) -> bool:
        """True if an authenticated check or answer came on this path: data may as well (RFC 8445 12.2)."""
        pair = self._list.pairs.get(path)
        return pair is not None and pair.heard

    # Input

    def receive_request(self, data: bytes, path: Path, now: float) -> None:
        request = self._authentic(data, self.local_credentials.password)
        if request is None:
            return
        # Recorded checks that an attacker sends again and again do not use up the peer's rate.
        is_new = request.transaction not in self._seen
        if not (self._answers if is_new else self._answers_again).take(now):
            self._counts["checks_over_rate"] += 1
            return
        if request.not_understood:  # RFC 8489 6.3.1
            self._answer_error(request, path, StunErrorCode(420, "Unknown Attribute"), request.not_understood)
        elif request.method != BINDING or request.priority is None:
            self._answer_error(request, path, StunErrorCode(400, "Bad Request"))
        elif self._role.conflicts(request) and self._role.keeps_against(request):
            self._answer_error(request, path, StunErrorCode(ROLE_CONFLICT, "Role Conflict"))
        else:
            if self._role.conflicts(request) and is_new and not self._retired:
                self._role.switch()
                self._repeat_checks_with_new_role()
            success = Message(Kind.SUCCESS, request.transaction, mapped=path.remote)
            self._out.append(Datagram(serialize(success, self.local_credentials.password), path))
            self._learn_from_check(request, path, is_new, now)

    def has_asked(self, transaction: bytes) -> bool:
        return transaction in self._transactions

    def receive_response(self, data: bytes, transaction_id: bytes, path: Path, now: float) -> None:
        transaction = self._transactions.get(transaction_id)
        if transaction is None or self.remote_credentials is None:
            self._counts["unknown_transaction"] += 1
            return
        response = self._authentic(data, self.remote_credentials.password)
        if response is None:
            return  # also an error without integrity: any sender could have made it
        if path != transaction.path or response.not_understood:  # RFC 8445 7.2.5.2.1, RFC 8489 6.3.3
            self._counts["unexpected_response"] += 1
            return
        self._forget(transaction)
        pair = transaction.pair
        if response.kind is Kind.SUCCESS:
            self._succeeded(transaction, now)
        elif response.error is not None and response.error.code == ROLE_CONFLICT:
            if transaction.controlling is self._role.controlling:  # else it has switched already
                self._role.told_to_switch(self._rng)
                self._repeat_checks_with_new_role()
            self._trigger(pair, now)
        else:
            self._counts["check_refused"] += 1
            if pair.state is PairState.IN_PROGRESS:
                pair.state = PairState.FAILED

    def take_datagrams(self) -> list[Datagram]:
        out, self._out = self._out, []
        return out

    # Time

    def timer(self) -> float | None:
        if self.failed:
            return None
        times = [transaction.due_at for transaction in self._transactions.values()]
        if self.remote_credentials is not None and self._has_checks_to_begin():
            times.append(self._next_check_at)
        if self.consent is not None:
            times += (self.consent.next_check_at, self.consent.expires_at)
        elif self._fails_at is not None:
            times.append(self._fails_at)
        if self._nominate_at is not None and self._role.controlling:
            times.append(self._nominate_at)
        if self._rival is not None:
            times.append(self._rival[2])
        return min(times, default=None)

    def handle_timer(self, now: float) -> None:
        if self.consent is None and self._fails_at is not None and now >= self._fails_at:
            self.failed = True
        if self.consent is not None and now >= self.consent.expires_at:
            self.failed = True
        if self.failed:
            return
        self._handle_due_transactions(now)
        if self.remote_credentials is not None and now >= self._next_check_at:
            self._begin_next_check(now)
        if self.consent is not None and self.selected is not None and now >= self.consent.next_check_at:
            self.consent.checked(now)
            self._send_consent_check(self.selected, now)
        if self._rival is not None and now >= self._rival[2]:
            self._settle_rival(now)
        if self._nominate_at is not None and now >= self._nominate_at:
            self._nominate_best(now)

    # Checks of the peer

    def _authentic(self, data: bytes, password: str) -> Message | None:
        try:
            message = parse(data)
        except StunError:
            self._counts["malformed"] += 1
            return None
        if not is_authentic(data, password):
            # RFC 8489 9.1.3 answers 400 or 401. Silence gives a stranger nothing, and nothing to aim at others.
            self._counts["unauthentic"] += 1
            return None
        return message

    def _answer_error(self, request: Message, path: Path, error: StunErrorCode, unknown: tuple[int, ...] = ()) -> None:
        self._counts[f"answered_{error.code}"] += 1
        answer = Message(Kind.ERROR, request.transaction, request.method, error=error, unknown_attributes=unknown)
        self._out.append(Datagram(serialize(answer, self.local_credentials.password), path))

    def _learn_from_check(self, request: Message, path: Path, is_new: bool, now: float) -> None:
        """Learn a path, a nomination or consent from a check (RFC 8445 7.3.1.3 to 7.3.1.5).

        A known check that comes again may be a repetition of the peer, by another port of its NAT, or that of an
        attacker who has recorded it. It may show a path, which counts for nothing until the peer has answered there; it
        is not a sign of consent, and does not choose among paths that work.
        """
        pair = self._list.pairs.get(path) or self._pair_shown_by(request, path, now)
        if pair is None:
            return
        pair.heard = True
        self._directory.hint(path, self._agent)
        if self._retired:
            return
        if is_new:
            self._remember(request.transaction)
            if pair is self.selected and self.consent is not None:
                self.consent.given(now)
        nominates = request.use_candidate and not self._role.controlling
        if pair.state is not PairState.SUCCEEDED or not self._is_fresh(pair, now):
            pair.nominated_by_peer |= nominates
            self._trigger(pair, now)
        elif nominates and is_new:
            self._nominated(pair, now)

    def _remember(self, transaction: bytes) -> None:
        self._seen[transaction] = None
        if len(self._seen) > self._settings.remembered_checks:
            del self._seen[next(iter(self._seen))]

    def _pair_shown_by(self, request: Message, path: Path, now: float) -> Pair | None:
        """Add a pair that is not in the check list. Its address may be new: a peer-reflexive candidate (7.3.1.3)."""
        remote = self._remotes.at(path)
        if remote is None:
            if not self._make_place_for_reflexive(now):
                self._counts["too_many_addresses"] += 1
                return None
            remote = self._remotes.add_reflexive(path, request.priority or 1)
        self._list.pairs[path] = Pair(path, self._local_at(path), remote)
        self._drop(self._list.trim(self._role.controlling, self.selected))
        return self._list.pairs.get(path)

    def _make_place_for_reflexive(self, now: float) -> bool:
        """Make place for a new address: one that has not answered of late gives way, for the peer has left it, or was
        never there. Return False if none does."""
        crowd = self._remotes.must_give_way()
        for candidate in crowd:
            pairs = [pair for pair in self._list.pairs.values() if pair.remote is candidate]
            if not any(pair is self.selected or self._is_fresh(pair, now) for pair in pairs):
                self._remotes.remove(candidate)
                for pair in pairs:
                    del self._list.pairs[pair.path]
                self._drop(pairs)
                return True
        return not crowd

    def _local_at(self, path: Path) -> Candidate:
        """Return the candidate whose base was asked; an address without a candidate counts as a host candidate."""
        for local in self._locals:
            if local.base == path.local and local.candidate.transport == path.transport:
                return local.candidate
        host, port = path.local
        tcp_type: TcpType | None = "passive" if path.transport == "tcp" else None
        name, priority = foundation("host", host, path.transport), candidate_priority("host", 0, tcp_type)
        return Candidate(name, 1, path.transport, priority, host, port, "host", tcp_type=tcp_type)

    # Checks of this side

    @property
    def is_nominated(self) -> bool:
        return self.selected is not None and self.selected.nominated

    @property
    def _rto(self) -> float:
        """The wait of RFC 8445 14.3; on a path that is known to be long, no less than an answer takes."""
        busy = len(self._list.unresolved()) * self._settings.check_interval
        return max(self._settings.rto, busy, 1.5 * (self.rtt or 0.0))

    def _trigger(self, pair: Pair, now: float) -> None:
        """Check this pair next (RFC 8445 7.3.1.4)."""
        if pair.state is PairState.IN_PROGRESS:
            self._repeat_early(pair, now)
            return
        pair.state = PairState.WAITING
        if pair not in self._triggered:
            self._triggered.append(pair)

    def _repeat_early(self, pair: Pair, now: float) -> None:
        """Ask again now: the peer's NAT lets this side in since the peer has sent.

        RFC 8445 7.3.1.4 begins another transaction; the same one once more needs no further state.
        """
        for transaction in self._transactions.values():
            if transaction.pair is pair and transaction.repeat_at is not None:
                if now - transaction.last_sent_at >= max(self._settings.check_interval, self.rtt or 0.0):
                    transaction.last_sent_at = now
                    self._out.append(Datagram(transaction.data, pair.path))
                return

    def _has_checks_to_begin(self) -> bool:
        if self._triggered:
            return True
        return not self.is_nominated and self._list.next_ordinary(self._role.controlling) is not None

    def _begin_next_check(self, now: float) -> None:
        """Begin the next check, triggered ones first (RFC 8445 6.1.4.2)."""
        pair = self._triggered.popleft() if self._triggered else None
        if pair is None and not self.is_nominated:
            pair = self._list.next_ordinary(self._role.controlling)
        if pair is not None:
            pair.state = PairState.IN_PROGRESS
            self._send_check(pair, now, nominates=False).begin(self._rto, self._settings)
            self._next_check_at = now + self._settings.check_interval

    def _send_consent_check(self, pair: Pair, now: float) -> None:
        """Check consent. Repeat the nomination as well, so that a peer that sees another address of this side moves
        there at once."""
        self._send_check(pair, now, nominates=self._role.controlling and pair.nominated)

    def _send_check(self, pair: Pair, now: float, nominates: bool) -> Transaction:
        """Send a Binding request (RFC 8445 7.1), whose answer counts for 30 s unless the caller says otherwise."""
        assert self.remote_credentials is not None  # nothing is checked before
        controlling = self._role.controlling
        request = Message(
            Kind.REQUEST,
            self._rng.randbytes(12),
            username=f"{self.remote_credentials.ufrag}:{self.local_credentials.ufrag}",
            priority=as_peer_reflexive(pair.local),
            use_candidate=nominates,
            controlling=self._role.tie_breaker if controlling else None,
            controlled=None if controlling else self._role.tie_breaker,
        )
        data = serialize(request, self.remote_credentials.password)
        expires_at = now + self._settings.consent_seconds
        transaction = Transaction(request.transaction, data, pair, controlling, nominates, now, expires_at)
        transaction.last_sent_at = now
        self._transactions[transaction.id] = transaction
        self._directory.transactions[transaction.id] = self._agent
        self._out.append(Datagram(data, pair.path))
        return transaction

    def _handle_due_transactions(self, now: float) -> None:
        for transaction in [each for each in self._transactions.values() if now >= each.due_at]:
            if now >= transaction.expires_at:
                self._forget(transaction)
                if transaction.pair.state is PairState.IN_PROGRESS:
                    transaction.pair.state = PairState.FAILED
                if transaction.nominates and not self.is_nominated:
                    self._nominate_at = now  # another pair
            else:
                self._out.append(Datagram(transaction.data, transaction.path))
                transaction.repeated(now, self._settings)

    def _succeeded(self, transaction: Transaction, now: float) -> None:
        """Take the success of a check (RFC 8445 7.2.5.3). The mapped address makes no pair: its base is the same."""
        pair = transaction.pair
        took = now - transaction.sent_at  # more than the round trip if this answers a repetition
        self.rtt = took if self.rtt is None else min(self.rtt, took)
        pair.state, pair.heard, pair.answered_at = PairState.SUCCEEDED, True, now
        self._directory.claim(pair.path, self._agent)
        if pair is self.selected and self.consent is not None:
            self.consent.given(now)
        if self._role.controlling:
            if transaction.nominates and transaction.controlling:
                self._nominated(pair, now)
        elif pair.nominated_by_peer:
            self._nominated(pair, now)
        pair.nominated_by_peer = False
        if not self.is_nominated:
            self._select(self._best(now) or pair, now)
            self._plan_nomination(now)
        if pair is self.selected:
            self._agent.answered(self, took)

    def _repeat_checks_with_new_role(self) -> None:
        """Repeat the checks that are under way, which state the old role."""
        for transaction in self._transactions.values():
            transaction.repeat_at = None
        for pair in self._list.pairs.values():
            if pair.state is PairState.IN_PROGRESS:
                pair.state = PairState.WAITING
                self._triggered.append(pair)
        self._nominate_at = 0.0 if self.selected is not None else None

    def _drop(self, pairs: list[Pair]) -> None:
        for pair in pairs:
            self._agent.release(pair.path)
            if pair in self._triggered:
                self._triggered.remove(pair)
        for transaction in [each for each in self._transactions.values() if each.pair in pairs]:
            self._forget(transaction)

    def _forget(self, transaction: Transaction) -> None:
        self._transactions.pop(transaction.id, None)
        self._directory.transactions.pop(transaction.id, None)

    # Choice of the path

    def _is_fresh(self, pair: Pair, now: float) -> bool:
        return pair.answered_at is not None and now - pair.answered_at < self._settings.consent_seconds

    def _best(self, now: float) -> Pair | None:
        works = (pair for pair in self._list.pairs.values() if self._is_fresh(pair, now))
        return max(works, key=lambda pair: pair.priority(self._role.controlling), default=None)

    def _select(self, pair: Pair, now: float) -> None:
        if pair is not self.selected:
            self.selected, self.was_connected = pair, True
            self.consent = Consent(pair.answered_at or now, now, self._settings, self._rng)

    def _plan_nomination(self, now: float) -> None:
        """Plan a regular nomination (RFC 8445 8.1.1): at once if nothing better can come, else a little later."""
        if not self._role.controlling or self._nominate_at is not None or self._nominating:
            return
        assert self.selected is not None  # a pair has just succeeded
        best = self.selected.priority(True)
        better = any(pair.priority(True) > best for pair in self._list.unresolved())
        self._nominate_at = now + (max(self._settings.nomination_wait, self.rtt or 0.0) if better else 0.0)

    @property
    def _nominating(self) -> bool:
        ours = self._role.controlling
        return any(each.nominates and each.controlling is ours for each in self._transactions.values())

    def _nominate_best(self, now: float) -> None:
        self._nominate_at = None
        pair = self._best(now)
        if self._role.controlling and not self.is_nominated and not self._nominating and pair is not None:
            self._send_check(pair, now, nominates=True).begin(self._rto, self._settings)

    def _nominated(self, pair: Pair, now: float) -> None:
        """Take a nomination (RFC 8445 8.1.1 and 8.1.2).

        Peers go on nominating: libwebrtc when it has found another path, others of RFC 5245 with every check. The
        better path wins; a worse one replaces it when it does not answer any more.
        """
        current = self.selected
        if current is not None and current is not pair and current.nominated:
            if pair.priority(self._role.controlling) < current.priority(self._role.controlling):
                if self._rival is None or self._rival[0] is not pair:
                    self._rival = (pair, now, now + max(self._settings.rival_wait, 2 * (self.rtt or 0.0)))
                    self._send_consent_check(current, now)
                return
            current.nominated = False
        pair.nominated = True
        self._rival = None
        self._select(pair, now)
        self._drop(self._list.remove_undecided())

    def _settle_rival(self, now: float) -> None:
        assert self._rival is not None  # the caller has checked
        pair, since, _ = self._rival
        self._rival = None
        current = self.selected
        answered = current is not None and current.answered_at is not None and current.answered_at >= since
        if not answered and self._list.pairs.get(pair.path) is pair:
            if current is not None:
                current.nominated = False
            pair.nominated = True
            self._select(pair, now)


def as_peer_reflexive(candidate: Candidate) -> int:
    """Return the PRIORITY of a check: the priority that the peer would give a peer-reflexive candidate of this base
    (RFC 8445 7.1.1)."""
    local_preference = candidate.priority >> 8 & (0x1FFF if candidate.tcp_type else 0xFFFF)
    return candidate_priority("prflx", local_preference, candidate.tcp_type)
