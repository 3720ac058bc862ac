"""The pair to send on (RFC 8445 8), and consent to send on it."""

from random import Random

from lockstep.rtc.ice.check_list import CheckList, Pair
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.session.consent import Consent
from lockstep.rtc.ice.session.own_checks import OwnChecks
from lockstep.rtc.ice.session.transactions import Transaction
from lockstep.rtc.ice.settings import IceSettings

__all__ = ["Selection"]


class Selection:
    """`pair` is set as soon as one works, and changes with nomination. `was_made`: there was one before."""

    def __init__(
        self, check_list: CheckList, checks: OwnChecks, role: Role, settings: IceSettings, rng: Random
    ) -> None:
        self.pair: Pair | None = None
        self.consent: Consent | None = None
        self.was_made = False
        self._list = check_list
        self._checks = checks
        self._role = role
        self._settings = settings
        self._rng = rng
        self._nominate_at: float | None = None
        self._rival: tuple[Pair, float, float] | None = None  # nominated instead of `pair`; beginning, deadline

    @property
    def is_nominated(self) -> bool:
        return self.pair is not None and self.pair.nominated

    def given(self, pair: Pair, now: float) -> None:
        """Note that the peer has answered on a pair, or has checked it."""
        if pair is self.pair and self.consent is not None:
            self.consent.given(now)

    def succeeded(self, transaction: Transaction, now: float) -> None:
        """Note that a check was answered."""
        pair = transaction.pair
        self.given(pair, now)
        if self._role.controlling:
            if transaction.nominates and transaction.controlling:
                self.nominated(pair, now)
        elif pair.nominated_by_peer:
            self.nominated(pair, now)
        pair.nominated_by_peer = False
        if not self.is_nominated:
            self._select(self._list.best(now) or pair, now)
            self._plan_nomination(now)

    def lost(self, now: float) -> None:
        """Select another pair: the path of this one has ended."""
        self.pair = self.consent = None
        if (best := self._list.best(now)) is not None:
            self._select(best, now)

    def _select(self, pair: Pair, now: float) -> None:
        if pair is not self.pair:
            self.pair, self.was_made = pair, True
            self.consent = Consent(pair.answered_at or now, now, self._settings, self._rng)

    # Time

    def timer(self) -> list[float]:
        """Return the times at which something is due."""
        times = []
        if self.consent is not None:
            times += [self.consent.next_check_at, self.consent.expires_at]
        if self._nominate_at is not None and self._role.controlling:
            times.append(self._nominate_at)
        if self._rival is not None:
            times.append(self._rival[2])
        return times

    def handle_timer(self, now: float) -> None:
        if self.consent is not None and self.pair is not None and now >= self.consent.next_check_at:
            self.consent.checked(now)
            self._check_consent(self.pair, now)
        if self._rival is not None and now >= self._rival[2]:
            self._settle_rival(*self._rival[:2], now)
        if self._nominate_at is not None and now >= self._nominate_at:
            self._nominate_best(now)

    def _check_consent(self, pair: Pair, now: float) -> None:
        """Check consent. Repeat the nomination as well, so that a peer that sees another address of this side moves
        there at once."""
        self._checks.send_once(pair, now, nominates=self._role.controlling and pair.nominated)

    # Nomination

    def _plan_nomination(self, now: float) -> None:
        """Plan a regular nomination (RFC 8445 8.1.1): at once if nothing better can come, else a little later."""
        if not self._role.controlling or self._nominate_at is not None or self._checks.is_nominating:
            return
        assert self.pair is not None  # a pair has just succeeded
        best = self.pair.priority(True)
        better = any(pair.priority(True) > best for pair in self._list.unresolved())
        wait = max(self._settings.nomination_wait, self._checks.rtt or 0.0) if better else 0.0
        self._nominate_at = now + wait

    def plan_again(self, at: float | None) -> None:
        """Nominate at this time: the last nomination was not answered, or stated another role. None: when a pair
        works."""
        self._nominate_at = at

    def _nominate_best(self, now: float) -> None:
        self._nominate_at = None
        pair = self._list.best(now)
        if self._role.controlling and not self.is_nominated and not self._checks.is_nominating and pair is not None:
            self._checks.send_repeatedly(pair, now, nominates=True)

    def nominated(self, pair: Pair, now: float) -> None:
        """Take a nomination (RFC 8445 8.1.1 and 8.1.2).

        Peers go on nominating: libwebrtc when it has found another path, others of RFC 5245 with every check. The
        better path wins; a worse one replaces it when it does not answer any more.
        """
        current = self.pair
        if current is not None and current is not pair and current.nominated:
            if pair.priority(self._role.controlling) < current.priority(self._role.controlling):
                if self._rival is None or self._rival[0] is not pair:
                    wait = max(self._settings.rival_wait, 2 * (self._checks.rtt or 0.0))
                    self._rival = (pair, now, now + wait)
                    self._check_consent(current, now)
                return
            current.nominated = False
        pair.nominated = True
        self._rival = None
        self._select(pair, now)
        self._checks.drop(self._list.remove_undecided())

    def _settle_rival(self, pair: Pair, since: float, now: float) -> None:
        self._rival = None
        current = self.pair
        answered = current is not None and current.answered_at is not None and current.answered_at >= since
        if not answered and self._list.pairs.get(pair.path) is pair:
            if current is not None:
                current.nominated = False
            pair.nominated = True
            self._select(pair, now)

    def retire(self) -> None:
        """Keep the pair, and ask nothing more."""
        self.consent = self._rival = self._nominate_at = None
