"""The control seat: who holds it, and the moves of its table. No I/O, no clock.

A new holder has to send a neutral command before a moving one (`may_move`): a stick that is held while the seat
changes hands moves nothing.
"""

from lockstep.protocol.console import Role
from lockstep.server.control.policies.seat_offer import Offer
from lockstep.server.control.seat.claims import Claims
from lockstep.server.control.seat.seat_table import NOTHING, TABLE, Move, SeatInput, SeatOutcome, SeatRefusal, Standing
from lockstep.server.control.seat.seat_times import Heartbeat, IdleTime, SeatTimes

__all__ = ["ControlSeat"]


class ControlSeat:
    """The state of the seat. Peers are known by their ids; `now` is monotonic seconds.

    `SeatRules` makes its moves. Call `neutral` for every neutral command that was executed, and `neutral_needed` when
    another one has to come before the robot may move.

    Attributes:
        holder: "" while the seat is free
        why: the input that decided on the holder, "" at first
        offer: to policies; None: no policy may have the seat
        claims: of those who ask for it
        heartbeat: of the holder
        idle: time of the holder without an intention to move
        times: its time limits
    """

    def __init__(self, times: SeatTimes) -> None:
        self.holder = ""
        self.why = ""
        self.offer: Offer | None = None
        self.claims = Claims(times.claim)
        self.heartbeat = Heartbeat(times.heartbeat)
        self.idle = IdleTime(times.idle)
        self.times = times
        self._role: Role = "operator"  # of the holder
        self._proven = False  # a neutral command of the holder was executed since one was needed

    def standing(self, peer: str) -> Standing:
        if not self.holder:
            return Standing.FREE
        if self.holder == peer:
            return Standing.HOLDER
        if self.policy_drives:
            return Standing.POLICY
        return Standing.CLAIMANT if peer in self.claims else Standing.OTHER

    def holds(self, peer: str) -> bool:
        return self.standing(peer) is Standing.HOLDER

    @property
    def policy_drives(self) -> bool:
        """True if a policy holds the seat."""
        return bool(self.holder) and self._role == "policy"

    def may_move(self, peer: str) -> bool:
        """True if `peer` holds the seat and a neutral command of it was executed since one was last needed."""
        return self.holds(peer) and self._proven

    def neutral(self, peer: str) -> None:
        self._proven = self._proven or self.holds(peer)

    def neutral_needed(self) -> None:
        """Require another neutral command before anybody moves the robot."""
        self._proven = False

    def step(self, peer: str, what: SeatInput, now: float, role: Role = "operator") -> SeatOutcome:
        """Make the move of the table. `role`: of `peer`, for inputs that may seat it."""
        match TABLE[self.standing(peer), what]:
            case Move.NOTHING:
                return NOTHING
            case Move.SEATED:
                return self._seat(peer, what, now, role)
            case Move.STAYS:
                return SeatOutcome(changed=self.idle.restart(now))
            case Move.LEAVES:
                return self._seat(self.claims.first, what, now)
            case Move.CLAIMS:
                refusal = self.claims.ask(peer, now)
                return SeatOutcome(changed=refusal is None, refusal=refusal)
            case Move.WITHDRAWS:
                self.claims.drop(peer)
                return SeatOutcome(changed=True)
            case Move.REFUSED_TAKEN:
                return SeatOutcome(refusal=SeatRefusal(peer, "seat_taken"))
            case Move.REFUSED_DECLINED:
                self.claims.decline(peer, now)
                return SeatOutcome(changed=True, refusal=SeatRefusal(peer, "declined", what.value))

    def _seat(self, peer: str, what: SeatInput, now: float, role: Role = "operator") -> SeatOutcome:
        """Give the seat to `peer`, or to nobody. One offer is one turn: it lives on only with a policy that begins."""
        rest = bool(self.holder)
        self._role = role
        if role != "policy":
            self.offer = None
        self.holder, self.why = peer, (SeatInput.REQUEST if what is SeatInput.REQUEST_IF_FREE else what).value
        self.heartbeat.heard(now)
        self.idle.restart(now)
        self._proven = False
        self.claims.drop(peer)
        return SeatOutcome(rest=rest, changed=True)
