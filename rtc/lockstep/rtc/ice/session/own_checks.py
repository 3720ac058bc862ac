"""The checks of this side (RFC 8445 6.1.4, 7.2): ordinary and triggered ones, nominations, and those of consent."""

from collections import deque
from random import Random

from lockstep.rtc.addresses import Datagram
from lockstep.rtc.ice.candidates import Candidate, candidate_priority
from lockstep.rtc.ice.check_list import CheckList, Pair, PairState
from lockstep.rtc.ice.credentials import Credentials
from lockstep.rtc.ice.directory import Entries
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.session.transactions import Transaction
from lockstep.rtc.ice.settings import IceSettings
from lockstep.rtc.stun import Kind, Message, serialize

__all__ = ["OwnChecks"]


class OwnChecks:
    """Sends checks at their pace, and repeats them. `out` has them; drained.

    `transactions` are those whose answer is awaited. `remote_credentials`: None until they are known, before which
    nothing is checked. `rtt`: the shortest round trip that was measured, in s.
    """

    def __init__(
        self, ufrag: str, check_list: CheckList, role: Role, entries: Entries, settings: IceSettings, rng: Random
    ) -> None:
        """`ufrag`: of this side."""
        self.remote_credentials: Credentials | None = None
        self.transactions: dict[bytes, Transaction] = {}
        self.rtt: float | None = None
        self.out: list[Datagram] = []
        self._ufrag = ufrag
        self._list = check_list
        self._role = role
        self._entries = entries
        self._settings = settings
        self._rng = rng
        self._triggered: deque[Pair] = deque()
        self._next_at = 0.0

    def begin(self, credentials: Credentials, now: float) -> None:
        self.remote_credentials = credentials
        self._next_at = now

    def trigger(self, pair: Pair, now: float) -> None:
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
        for transaction in self.transactions.values():
            if transaction.pair is pair and transaction.repeat_at is not None:
                if now - transaction.last_sent_at >= max(self._settings.check_interval, self.rtt or 0.0):
                    transaction.last_sent_at = now
                    self.out.append(Datagram(transaction.data, pair.path))
                return

    def timer(self, *, ordinary: bool) -> list[float]:
        """Return the times at which something is due. `ordinary`: False if only triggered checks are begun."""
        times = [transaction.due_at for transaction in self.transactions.values()]
        has_more = self._triggered or (ordinary and self._list.next_ordinary() is not None)
        if has_more and self.remote_credentials is not None:
            times.append(self._next_at)
        return times

    def begin_next(self, now: float, *, ordinary: bool) -> None:
        """Begin the next check when its time has come, triggered ones first (RFC 8445 6.1.4.2)."""
        if self.remote_credentials is None or now < self._next_at:
            return
        pair = self._triggered.popleft() if self._triggered else None
        if pair is None and ordinary:
            pair = self._list.next_ordinary()
        if pair is not None:
            pair.state = PairState.IN_PROGRESS
            self.send_repeatedly(pair, now, nominates=False)
            self._next_at = now + self._settings.check_interval

    def send_repeatedly(self, pair: Pair, now: float, *, nominates: bool) -> None:
        """Send a check until it is answered, with the wait of RFC 8445 14.3; on a path that is known to be long, no
        less than an answer takes."""
        transaction = self.send_once(pair, now, nominates=nominates)
        busy = len(self._list.unresolved()) * self._settings.check_interval
        transaction.begin(max(self._settings.rto, busy, 1.5 * (self.rtt or 0.0)), self._settings)

    def send_once(self, pair: Pair, now: float, *, nominates: bool) -> Transaction:
        """Send a Binding request (RFC 8445 7.1), whose answer counts for 30 s unless the caller says otherwise."""
        assert self.remote_credentials is not None  # nothing is checked before
        controlling = self._role.controlling
        request = Message(
            Kind.REQUEST,
            self._rng.randbytes(12),
            username=f"{self.remote_credentials.ufrag}:{self._ufrag}",
            priority=as_peer_reflexive(pair.local),
            use_candidate=nominates,
            controlling=self._role.tie_breaker if controlling else None,
            controlled=None if controlling else self._role.tie_breaker,
        )
        data = serialize(request, self.remote_credentials.password)
        expires_at = now + self._settings.consent_seconds
        transaction = Transaction(request.transaction, data, pair, controlling, nominates, now, expires_at)
        transaction.last_sent_at = now
        self.transactions[transaction.id] = transaction
        self._entries.add_transaction(transaction.id)
        self.out.append(Datagram(data, pair.path))
        return transaction

    @property
    def is_nominating(self) -> bool:
        ours = self._role.controlling
        return any(each.nominates and each.controlling is ours for each in self.transactions.values())

    def handle_timer(self, now: float) -> bool:
        """Repeat checks, and give up those that nobody answers. Return True if a nomination was one of them."""
        nomination_failed = False
        for transaction in [each for each in self.transactions.values() if now >= each.due_at]:
            if now >= transaction.expires_at:
                self.forget(transaction)
                if transaction.pair.state is PairState.IN_PROGRESS:
                    transaction.pair.state = PairState.FAILED
                nomination_failed |= transaction.nominates
            else:
                self.out.append(Datagram(transaction.data, transaction.path))
                transaction.repeated(now, self._settings)
        return nomination_failed

    def succeeded(self, transaction: Transaction, now: float) -> float:
        """Take the success of a check (RFC 8445 7.2.5.3). The mapped address makes no pair: its base is the same.

        Return what the answer took, in s: more than the round trip if it answers a repetition.
        """
        pair, took = transaction.pair, now - transaction.sent_at
        self.rtt = took if self.rtt is None else min(self.rtt, took)
        pair.state, pair.heard, pair.answered_at = PairState.SUCCEEDED, True, now
        self._entries.claim(pair.path, self._ufrag)
        return took

    def repeat_with_new_role(self) -> None:
        """Repeat the checks that are under way, which state the old role."""
        for transaction in self.transactions.values():
            transaction.repeat_at = None
        for pair in self._list.pairs.values():
            if pair.state is PairState.IN_PROGRESS:
                pair.state = PairState.WAITING
                self._triggered.append(pair)

    def drop(self, pairs: list[Pair]) -> None:
        """Give up pairs that the check list has removed."""
        for pair in pairs:
            self._entries.release(pair.path, self._ufrag)
            if pair in self._triggered:
                self._triggered.remove(pair)
        for transaction in [each for each in self.transactions.values() if each.pair in pairs]:
            self.forget(transaction)

    def forget(self, transaction: Transaction) -> None:
        self.transactions.pop(transaction.id, None)
        self._entries.remove_transaction(transaction.id)

    def clear(self) -> None:
        """Forget every check."""
        for transaction in list(self.transactions.values()):
            self.forget(transaction)
        self._triggered.clear()


def as_peer_reflexive(candidate: Candidate) -> int:
    """Return the PRIORITY of a check: the priority that the peer would give a peer-reflexive candidate of this base
    (RFC 8445 7.1.1)."""
    local_preference = candidate.priority >> 8 & (0x1FFF if candidate.tcp_type else 0xFFFF)
    return candidate_priority("prflx", local_preference, candidate.tcp_type)
