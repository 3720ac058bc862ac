"""One ICE session (RFC 8445 6 to 8): the checks under one pair of credentials, and consent on the path they find."""

from collections import Counter
from collections.abc import Iterable
from random import Random

from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.ice.candidates import Candidate
from lockstep.rtc.ice.check_list import CheckList, LocalCandidate, PairState
from lockstep.rtc.ice.credentials import Credentials
from lockstep.rtc.ice.directory import Entries
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.session.own_checks import OwnChecks
from lockstep.rtc.ice.session.peer_checks import ROLE_CONFLICT, PeerChecks, authentic
from lockstep.rtc.ice.session.selection import Selection
from lockstep.rtc.ice.session.transactions import Transaction
from lockstep.rtc.ice.settings import IceSettings
from lockstep.rtc.stun import Kind, Message

__all__ = ["Session"]


class Session:
    """An ICE session (RFC 8445); a restart begins another one. `Agent` owns it and passes datagrams on.

    `selection` has the pair to send on. `answers` has what each answer on that pair took, in s, which its owner drains.
    `counts` has the dropped datagrams, by reason, and is shared with the agent.
    """

    def __init__(
        self,
        credentials: Credentials,
        candidates: Iterable[LocalCandidate],
        role: Role,
        entries: Entries,
        settings: IceSettings,
        rng: Random,
        counts: Counter[str],
    ) -> None:
        self.local_credentials = credentials
        self.failed = False  # no path was found in time, or consent has expired
        self.answers: list[float] = []
        self._retired = False
        self._role = role
        self._entries = entries
        self._settings = settings
        self._rng = rng
        self._counts = counts
        self._list = CheckList(candidates, role, settings)
        self._peer_checks = PeerChecks(credentials, role, settings, counts)
        self.checks = OwnChecks(credentials.ufrag, self._list, role, entries, settings, rng)
        self.selection = Selection(self._list, self.checks, role, settings, rng)
        self._fails_at: float | None = None
        entries.add_user(credentials.ufrag)

    def wait_for_remote(self, now: float) -> None:
        """Fail if there is no path `connect_seconds` from now."""
        self._fails_at = now + self._settings.connect_seconds

    def set_remote(self, credentials: Credentials, now: float) -> None:
        self.checks.begin(credentials, now)
        self.wait_for_remote(now)

    def add_remote_candidate(self, candidate: Candidate) -> None:
        """Add a candidate with an IP address, that signalling names."""
        if not self._list.remotes.add_signalled(candidate):
            self._counts["candidate_not_added"] += 1
        elif not self.selection.is_nominated:
            self.checks.drop(self._list.add(candidate, self.selection.pair))

    def end(self) -> None:
        """End the session, and leave nothing behind in the directory."""
        self._entries.remove_user(self.local_credentials.ufrag)
        self.checks.clear()
        pairs = list(self._list.pairs.values())
        self._list.pairs.clear()
        self.selection.pair = None
        self.selection.retire()
        self.checks.drop(pairs)

    def retire(self) -> None:
        """Answer checks and accept data that are under way, and ask nothing more: another session has taken over."""
        self._retired = True
        self._fails_at = self.checks.remote_credentials = None
        self.checks.clear()
        self.selection.retire()

    def path_closed(self, path: Path, now: float) -> None:
        """Note that the connection of a TCP path has ended."""
        pair = self._list.pairs.pop(path, None)
        if pair is None:
            return
        self.checks.drop([pair])
        if pair is self.selection.pair and not self._retired:
            self._fails_at = now + self._settings.consent_seconds  # time for the peer to connect again
            self.selection.lost(now)

    # Datagrams

    def receive_request(self, data: bytes, path: Path, now: float) -> None:
        request = self._peer_checks.receive(data, path, now)
        if request is None:
            return
        if self._role.conflicts(request) and self._peer_checks.is_new(request) and not self._retired:
            self._role.switch()
            self._repeat_with_new_role()
        self._learn_from_check(request, path, now)

    def _learn_from_check(self, request: Message, path: Path, now: float) -> None:
        """Learn a path, a nomination or consent from a check (RFC 8445 7.3.1.3 to 7.3.1.5).

        A known check that comes again may be a repetition of the peer, by another port of its NAT, or that of an
        attacker who has recorded it. It may show a path, which counts for nothing until the peer has answered there; it
        is not a sign of consent, and does not choose among paths that work.
        """
        if path not in self._list.pairs:
            removed = self._list.add_shown(path, request.priority or 1, self.selection.pair, now)
            if removed is None:
                self._counts["too_many_addresses"] += 1
                return
            self.checks.drop(removed)
        pair = self._list.pairs.get(path)
        if pair is None:
            return
        pair.heard = True
        self._entries.hint(path, self.local_credentials.ufrag)
        if self._retired:
            return
        is_new = self._peer_checks.is_new(request)
        if is_new:
            self._peer_checks.remember(request)
            self.selection.given(pair, now)
        nominates = request.use_candidate and not self._role.controlling
        if pair.state is not PairState.SUCCEEDED or not self._list.is_fresh(pair, now):
            pair.nominated_by_peer |= nominates
            self.checks.trigger(pair, now)
        elif nominates and is_new:
            self.selection.nominated(pair, now)

    def receive_response(self, data: bytes, transaction_id: bytes, path: Path, now: float) -> None:
        transaction = self.checks.transactions.get(transaction_id)
        remote = self.checks.remote_credentials
        if transaction is None or remote is None:
            self._counts["unknown_transaction"] += 1
            return
        response = authentic(data, remote.password, self._counts)
        if response is None:
            return  # also an error without integrity: any sender could have made it
        if path != transaction.path or response.not_understood:  # RFC 8445 7.2.5.2.1, RFC 8489 6.3.3
            self._counts["unexpected_response"] += 1
            return
        self.checks.forget(transaction)
        if response.kind is Kind.SUCCESS:
            self._succeeded(transaction, now)
        elif response.error is not None and response.error.code == ROLE_CONFLICT:
            if transaction.controlling is self._role.controlling:  # else it has switched already
                self._role.told_to_switch(self._rng)
                self._repeat_with_new_role()
            self.checks.trigger(transaction.pair, now)
        else:
            self._counts["check_refused"] += 1
            if transaction.pair.state is PairState.IN_PROGRESS:
                transaction.pair.state = PairState.FAILED

    def _succeeded(self, transaction: Transaction, now: float) -> None:
        took = self.checks.succeeded(transaction, now)
        self.selection.succeeded(transaction, now)
        if transaction.pair is self.selection.pair:
            self.answers.append(took)

    def _repeat_with_new_role(self) -> None:
        self.checks.repeat_with_new_role()
        self.selection.plan_again(0.0 if self.selection.pair is not None else None)

    def take_datagrams(self) -> list[Datagram]:
        out = self._peer_checks.out + self.checks.out
        self._peer_checks.out, self.checks.out = [], []
        return out

    # Time

    def timer(self) -> float | None:
        if self.failed:
            return None
        times = self.checks.timer(ordinary=not self.selection.is_nominated) + self.selection.timer()
        if self.selection.consent is None and self._fails_at is not None:
            times.append(self._fails_at)
        return min(times, default=None)

    def handle_timer(self, now: float) -> None:
        consent = self.selection.consent
        fails_at = self._fails_at if consent is None else consent.expires_at
        self.failed = self.failed or (fails_at is not None and now >= fails_at)
        if self.failed:
            return
        if self.checks.handle_timer(now) and not self.selection.is_nominated:
            self.selection.plan_again(now)  # another pair
        self.checks.begin_next(now, ordinary=not self.selection.is_nominated)
        self.selection.handle_timer(now)
