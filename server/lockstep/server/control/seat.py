"""The control seat, the right to drive. No I/O, no clock.

At most one peer holds the seat. It never stays with a peer that is gone, silent or idle, and whenever it changes hands
the robot rests first. Each input is about one peer, to which the seat is FREE, its own (HOLDER), another person's while
it asks for it (CLAIMANT), another person's (OTHER), or a policy's (POLICY):

| input | FREE | HOLDER | CLAIMANT | OTHER | POLICY |
|---|---|---|---|---|---|
| request | seated | stays, idle time anew | – | claims | seated (as "taken") |
| request if free | seated | – | refused seat_taken | refused seat_taken | refused seat_taken |
| take | seated | stays, idle time anew | seated | seated | seated |
| granted by the holder | – | – | seated | – | – |
| declined by the holder | – | – | refused declined | – | – |
| no answer for `claim_seconds` | – | – | refused declined | – | – |
| release | – | leaves | withdraws | – | – |
| disconnected | – | leaves | withdraws | – | – |
| heartbeat lost for `heartbeat_seconds` and four round trips | – | leaves | – | – | – |
| idle for `idle_seconds` | – | leaves | – | – | – |
| offered to policies, by the holder | – | leaves | – | – | – |
| the offer ends, of the policy that drives | – | leaves | – | – | – |

*Seated* while somebody else holds it, and *leaves*, rest the robot. When the holder leaves, the claim that has waited
longest gets the seat; without a claim the seat is free. A claim goes to each later holder too and keeps its deadline.

Before the table applies: a role that may not drive is refused `not_allowed`; so is the take of an operator while
another person holds the seat; a grant or decline by another than the holder is refused `no_seat`; a claim too many, or
soon after a decline, is refused.

A policy is seated only in a free seat that a person has offered (`policies/seat_offer.py`); it never claims, takes or
answers. Every person's request takes the seat from it at once.

A lost packet silences a browser's data channels for a round trip or two, and once more until SCTP has told the other
side what it gave up, so that a silence has to be longer on a longer path. The robot does not wait for it: without
commands it rests within its `hold`.

A new holder has to send a neutral command before a moving one (`may_move`): a stick that is held while the seat
changes hands moves nothing.
"""

from collections.abc import Iterator
from enum import Enum
from typing import NamedTuple

from lockstep.protocol.console import PEOPLE, Role
from lockstep.protocol.messages import RefusalReason
from lockstep.server.control.policies.seat_offer import Offer

__all__ = ["TABLE", "ControlSeat", "Move", "SeatInput", "SeatOutcome", "SeatRefusal", "SeatTimes", "Standing"]

COUNTDOWN = 30.0  # s before the idle release, announced to everyone
MAX_CLAIMS = 8
ROUND_TRIPS, MOST_ROUND_TRIPS = 4, 5.0  # by which a silence may be longer on a long path, and their bound in s
DECLINED_FOR = 5.0  # s after a decline in which the same peer cannot claim again


class Standing(Enum):
    FREE = "free"
    HOLDER = "holder"
    CLAIMANT = "claimant"
    OTHER = "other"
    POLICY = "policy"


class SeatInput(Enum):
    """An input of the seat. Its value tells everyone the reason of a change."""

    REQUEST = "request"
    REQUEST_IF_FREE = "request if free"
    TAKE = "taken"
    GRANTED = "granted"
    DECLINED = "declined"
    UNANSWERED = "no answer"
    RELEASE = "released"
    GONE = "disconnected"
    SILENT = "heartbeat lost"
    IDLE = "idle"
    OFFERED = "offered"
    WITHDRAWN = "offer withdrawn"
    STOPPED = "stopped"
    LINK_LOST = "robot link lost"
    UNATTENDED = "nobody attends"


OFFER_ENDS = (SeatInput.WITHDRAWN, SeatInput.STOPPED, SeatInput.LINK_LOST, SeatInput.UNATTENDED)


class Move(Enum):
    NOTHING = "nothing"
    SEATED = "seated"
    STAYS = "stays"
    LEAVES = "leaves"
    CLAIMS = "claims"
    WITHDRAWS = "withdraws"
    REFUSED_TAKEN = "refused seat_taken"
    REFUSED_DECLINED = "refused declined"


class SeatRefusal(NamedTuple):
    """A refusal to send to `peer`."""

    peer: str
    reason: RefusalReason
    detail: str = ""


class SeatOutcome(NamedTuple):
    """The effects of an input, in this order: rest the robot, tell everyone, refuse. All false: none."""

    rest: bool = False
    changed: bool = False
    refusal: SeatRefusal | None = None


class SeatTimes(NamedTuple):
    """Time limits of the seat, in seconds."""

    heartbeat: float = 3.0  # of silence, and some round trips of the holder's path
    idle: float = 300.0  # without an intention to move
    claim: float = 60.0  # until a claim counts as declined


NOTHING = SeatOutcome()

_LEAVES = (Move.NOTHING, Move.LEAVES, Move.NOTHING, Move.NOTHING, Move.NOTHING)
_ROWS: dict[SeatInput, tuple[Move, Move, Move, Move, Move]] = {
    SeatInput.REQUEST: (Move.SEATED, Move.STAYS, Move.NOTHING, Move.CLAIMS, Move.SEATED),
    SeatInput.REQUEST_IF_FREE: (
        *(Move.SEATED, Move.NOTHING),
        *(Move.REFUSED_TAKEN, Move.REFUSED_TAKEN, Move.REFUSED_TAKEN),
    ),
    SeatInput.TAKE: (Move.SEATED, Move.STAYS, Move.SEATED, Move.SEATED, Move.SEATED),
    SeatInput.GRANTED: (Move.NOTHING, Move.NOTHING, Move.SEATED, Move.NOTHING, Move.NOTHING),
    SeatInput.DECLINED: (Move.NOTHING, Move.NOTHING, Move.REFUSED_DECLINED, Move.NOTHING, Move.NOTHING),
    SeatInput.UNANSWERED: (Move.NOTHING, Move.NOTHING, Move.REFUSED_DECLINED, Move.NOTHING, Move.NOTHING),
    SeatInput.RELEASE: (Move.NOTHING, Move.LEAVES, Move.WITHDRAWS, Move.NOTHING, Move.NOTHING),
    SeatInput.GONE: (Move.NOTHING, Move.LEAVES, Move.WITHDRAWS, Move.NOTHING, Move.NOTHING),
    SeatInput.SILENT: _LEAVES,
    SeatInput.IDLE: _LEAVES,
    SeatInput.OFFERED: _LEAVES,
    **dict.fromkeys(OFFER_ENDS, _LEAVES),
}
TABLE: dict[tuple[Standing, SeatInput], Move] = {
    (standing, what): move for what, row in _ROWS.items() for standing, move in zip(Standing, row, strict=True)
}


class ControlSeat:
    """The state of the seat. Peers are known by their ids; `now` is monotonic seconds.

    Call `heard` for every valid message of a peer, `moved` for every moving command of the holder that passed,
    `neutral` for every neutral one that was executed, `neutral_needed` when another one has to come before the robot
    may move, and `expire` a few times a second.

    Attributes:
        holder: "" while the seat is free
        why: the input that decided on the holder, "" at first
        offer: to policies; None: no policy may have the seat
        times: its time limits
    """

    def __init__(self, times: SeatTimes) -> None:
        self.holder = ""
        self.why = ""
        self.times = times
        self.offer: Offer | None = None
        self._role: Role = "operator"  # of the holder
        self._attended_at = 0.0  # last message of the person who made the offer
        self._attended_round_trip = 0.0  # s, of that person
        self._heard_at = 0.0
        self._round_trip = 0.0  # s, of the holder
        self._moved_at = 0.0
        self._counting = False  # everyone was told of the idle countdown
        self._proven = False  # a neutral command of the holder was executed since one was needed
        self._claims: dict[str, float] = {}  # peer -> deadline, oldest first
        self._declined: dict[str, float] = {}  # peer -> time from which it may claim again

    def standing(self, peer: str) -> Standing:
        if not self.holder:
            return Standing.FREE
        if self.holder == peer:
            return Standing.HOLDER
        if self.policy_drives:
            return Standing.POLICY
        return Standing.CLAIMANT if peer in self._claims else Standing.OTHER

    def holds(self, peer: str) -> bool:
        return self.standing(peer) is Standing.HOLDER

    @property
    def policy_drives(self) -> bool:
        """True if a policy holds the seat."""
        return bool(self.holder) and self._role == "policy"

    def may_move(self, peer: str) -> bool:
        """True if `peer` holds the seat and a neutral command of it was executed since one was last needed."""
        return self.holds(peer) and self._proven

    def claims(self, now: float) -> dict[str, float]:
        """Return the peers that ask for the seat, longest waiting first, with the seconds left to each."""
        return {peer: max(0.0, deadline - now) for peer, deadline in self._claims.items()}

    def idle_seconds_left(self, now: float) -> float | None:
        """Return the seconds until the idle holder loses the seat; None unless everyone is to see the countdown."""
        return max(0.0, self._idle_at() - now) if self._counting else None

    # requests of peers

    def request(self, peer: str, role: Role, now: float, *, only_if_free: bool = False) -> SeatOutcome:
        if role == "policy":
            return self._request_by_policy(peer, now)
        if role not in PEOPLE:
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed"))
        what = SeatInput.REQUEST_IF_FREE if only_if_free else SeatInput.REQUEST
        if what is SeatInput.REQUEST and self.standing(peer) is Standing.POLICY:
            what = SeatInput.TAKE
        return self._step(peer, what, now, role)

    def _request_by_policy(self, peer: str, now: float) -> SeatOutcome:
        """Seat a policy if a person lets it; it waits for no seat."""
        match self.standing(peer):
            case Standing.FREE if self.offer is not None and self.offer.admits(peer):
                return self._step(peer, SeatInput.REQUEST, now, "policy")
            case Standing.FREE:
                return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "no person offers the seat to this policy"))
            case Standing.HOLDER:
                return NOTHING  # asking is no sign that it drives
            case _:
                return SeatOutcome(refusal=SeatRefusal(peer, "seat_taken"))

    def take(self, peer: str, role: Role, now: float) -> SeatOutcome:
        if role not in PEOPLE:
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "only people may take the seat"))
        if role != "supervisor" and self.standing(peer) in (Standing.CLAIMANT, Standing.OTHER):
            detail = "only a supervisor may take the seat from another person"
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", detail))
        return self._step(peer, SeatInput.TAKE, now, role)

    def answer(self, peer: str, claimant: str, now: float, *, grant: bool) -> SeatOutcome:
        """Take the answer of `peer` to the claim of `claimant`; ignore it if there is no such claim any more."""
        if not self.holds(peer):
            return SeatOutcome(refusal=SeatRefusal(peer, "no_seat", "only the holder of the seat may answer"))
        return self._step(claimant, SeatInput.GRANTED if grant else SeatInput.DECLINED, now)

    def release(self, peer: str, now: float) -> SeatOutcome:
        return self._step(peer, SeatInput.RELEASE, now)

    # the offer to policies

    def offer_to_policies(self, peer: str, role: Role, link: str, now: float, *, to: str = "") -> SeatOutcome:
        """Let a policy drive. `link`: of `peer`, which is responsible; `to`: the only policy, "": any."""
        if role not in PEOPLE:
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "only people may offer the seat"))
        if self.holder and not self.policy_drives and not self.holds(peer):
            return SeatOutcome(refusal=SeatRefusal(peer, "seat_taken", "its holder may offer it"))
        if self._claims:
            return SeatOutcome(refusal=SeatRefusal(peer, "seat_taken", "somebody asks for the seat; answer first"))
        outcome = self._step(peer, SeatInput.OFFERED, now)
        self.offer = Offer(peer, link, self.holder or to, now + self.times.claim)
        self._attended_at, self._attended_round_trip = now, 0.0
        return outcome._replace(changed=True)

    def withdraw_offer(self, peer: str, role: Role, now: float) -> SeatOutcome:
        if role not in PEOPLE:
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "only people may withdraw the offer"))
        return self.end_offer(SeatInput.WITHDRAWN, now)

    def end_offer(self, what: SeatInput, now: float) -> SeatOutcome:
        """End the offer and the turn of the policy that drives. `what`: one of OFFER_ENDS."""
        if self.offer is None:
            return NOTHING
        self.offer = None
        if self.policy_drives:
            return self._step(self.holder, what, now)
        return SeatOutcome(changed=True)

    def attended(self, link: str, now: float, round_trip: float = 0.0) -> None:
        """Called for each message of a person. `link`: that person's; `round_trip`: s, as in `heard`."""
        if self.offer is not None and self.offer.link == link:
            self._attended_at, self._attended_round_trip = now, round_trip

    def person_left(self, link: str, now: float) -> SeatOutcome:
        """Called when the last connection of a link has ended with which a person takes part."""
        if self.offer is None or self.offer.link != link:
            return NOTHING
        return self.end_offer(SeatInput.UNATTENDED, now)

    # observations of peers

    def gone(self, peer: str, now: float) -> SeatOutcome:
        self._declined.pop(peer, None)
        return self._step(peer, SeatInput.GONE, now)

    def heard(self, peer: str, now: float, round_trip: float = 0.0) -> None:
        """Called for each message of `peer`. `round_trip`: s, as measured last; 0 before the first measurement."""
        if self.holds(peer):
            self._heard_at, self._round_trip = now, round_trip

    def neutral(self, peer: str) -> None:
        self._proven = self._proven or self.holds(peer)

    def neutral_needed(self) -> None:
        """Require another neutral command before anybody moves the robot."""
        self._proven = False

    def moved(self, peer: str, now: float) -> SeatOutcome:
        """Restart the idle time of the holder, and end a countdown."""
        return self._stay(now) if self.holds(peer) else NOTHING

    def expire(self, now: float) -> Iterator[SeatOutcome]:
        """Yield an outcome for each time limit that has run out; act on each before the next."""
        if self.offer is not None and now - self._attended_at >= self._patience(self._attended_round_trip):
            yield self.end_offer(SeatInput.UNATTENDED, now)
        if self.holder and now - self._heard_at >= self._patience(self._round_trip):
            yield self._step(self.holder, SeatInput.SILENT, now)
        if self.holder and now >= self._idle_at():
            yield self._step(self.holder, SeatInput.IDLE, now)
        for peer in [peer for peer, deadline in self._claims.items() if now >= deadline]:
            yield self._step(peer, SeatInput.UNANSWERED, now)
        if self.offer is not None and not self.holder and now >= self.offer.until:
            yield self.end_offer(SeatInput.WITHDRAWN, now)
        if self.holder and not self._counting and now >= self._idle_at() - COUNTDOWN:
            self._counting = True
            yield SeatOutcome(changed=True)

    def _patience(self, round_trip: float) -> float:
        """Return the seconds of silence after which a peer counts as gone."""
        return self.times.heartbeat + min(ROUND_TRIPS * round_trip, MOST_ROUND_TRIPS)

    # the moves

    def _step(self, peer: str, what: SeatInput, now: float, role: Role = "operator") -> SeatOutcome:
        """`role`: of `peer`, for inputs that may seat it."""
        match TABLE[self.standing(peer), what]:
            case Move.NOTHING:
                return NOTHING
            case Move.SEATED:
                return self._seat(peer, what, now, role)
            case Move.STAYS:
                return self._stay(now)
            case Move.LEAVES:
                return self._seat(next(iter(self._claims), ""), what, now)
            case Move.CLAIMS:
                return self._claim(peer, now)
            case Move.WITHDRAWS:
                del self._claims[peer]
                return SeatOutcome(changed=True)
            case Move.REFUSED_TAKEN:
                return SeatOutcome(refusal=SeatRefusal(peer, "seat_taken"))
            case Move.REFUSED_DECLINED:
                del self._claims[peer]
                self._declined[peer] = now + DECLINED_FOR
                return SeatOutcome(changed=True, refusal=SeatRefusal(peer, "declined", what.value))

    def _seat(self, peer: str, what: SeatInput, now: float, role: Role = "operator") -> SeatOutcome:
        """Give the seat to `peer`, or to nobody. One offer is one turn: it lives on only with a policy that begins."""
        rest = bool(self.holder)
        self._role = role
        if role != "policy":
            self.offer = None
        self.holder, self.why = peer, (SeatInput.REQUEST if what is SeatInput.REQUEST_IF_FREE else what).value
        self._heard_at = self._moved_at = now
        self._round_trip = 0.0
        self._counting = self._proven = False
        self._claims.pop(peer, None)
        return SeatOutcome(rest=rest, changed=True)

    def _stay(self, now: float) -> SeatOutcome:
        self._moved_at = now
        counting, self._counting = self._counting, False
        return SeatOutcome(changed=counting)

    def _claim(self, peer: str, now: float) -> SeatOutcome:
        self._declined = {each: until for each, until in self._declined.items() if until > now}
        if peer in self._declined:
            return SeatOutcome(refusal=SeatRefusal(peer, "declined", "ask again a little later"))
        if len(self._claims) >= MAX_CLAIMS:
            return SeatOutcome(refusal=SeatRefusal(peer, "seat_taken", "too many people wait for the seat"))
        self._claims[peer] = now + self.times.claim
        return SeatOutcome(changed=True)

    def _idle_at(self) -> float:
        return self._moved_at + self.times.idle
