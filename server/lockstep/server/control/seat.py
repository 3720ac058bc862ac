"""The control seat, the right to drive. No I/O, no clock.

At most one peer holds the seat. It never stays with a peer that is gone, silent or idle, and whenever it changes hands
the robot rests first. Each input is about one peer, to which the seat is FREE, its own (HOLDER), somebody else's while
it asks for it (CLAIMANT), or somebody else's (OTHER):

| input | FREE | HOLDER | CLAIMANT | OTHER |
|---|---|---|---|---|
| request | seated | stays, idle time anew | – | claims |
| request if free | seated | – | refused seat_taken | refused seat_taken |
| take (supervisor) | seated | stays, idle time anew | seated | seated |
| granted by the holder | – | – | seated | – |
| declined by the holder | – | – | refused declined | – |
| no answer for `claim_seconds` | – | – | refused declined | – |
| release | – | leaves | withdraws | – |
| disconnected | – | leaves | withdraws | – |
| heartbeat lost for `heartbeat_seconds` and four round trips | – | leaves | – | – |
| idle for `idle_seconds` | – | leaves | – | – |

*Seated* while somebody else holds it, and *leaves*, rest the robot. When the holder leaves, the claim that has waited
longest gets the seat; without a claim the seat is free. A claim goes to each later holder too and keeps its deadline.

Before the table applies: a role that may not drive is refused `not_allowed`, and so is take by anyone but a
supervisor; a grant or decline by another than the holder is refused `no_seat`; a claim too many, or soon after a
decline, is refused.

A lost packet silences a browser's data channels for a round trip or two, and once more until SCTP has told the other
side what it gave up, so that a silence has to be longer on a longer path. The robot does not wait for it: without
commands it rests within its `hold`.

A new holder has to send a neutral command before a moving one (`may_move`): a stick that is held while the seat
changes hands moves nothing.
"""

from collections.abc import Iterator
from enum import Enum
from typing import NamedTuple

from lockstep.protocol.console import Role
from lockstep.protocol.messages import RefusalReason

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

_ROWS: dict[SeatInput, tuple[Move, Move, Move, Move]] = {
    SeatInput.REQUEST: (Move.SEATED, Move.STAYS, Move.NOTHING, Move.CLAIMS),
    SeatInput.REQUEST_IF_FREE: (Move.SEATED, Move.NOTHING, Move.REFUSED_TAKEN, Move.REFUSED_TAKEN),
    SeatInput.TAKE: (Move.SEATED, Move.STAYS, Move.SEATED, Move.SEATED),
    SeatInput.GRANTED: (Move.NOTHING, Move.NOTHING, Move.SEATED, Move.NOTHING),
    SeatInput.DECLINED: (Move.NOTHING, Move.NOTHING, Move.REFUSED_DECLINED, Move.NOTHING),
    SeatInput.UNANSWERED: (Move.NOTHING, Move.NOTHING, Move.REFUSED_DECLINED, Move.NOTHING),
    SeatInput.RELEASE: (Move.NOTHING, Move.LEAVES, Move.WITHDRAWS, Move.NOTHING),
    SeatInput.GONE: (Move.NOTHING, Move.LEAVES, Move.WITHDRAWS, Move.NOTHING),
    SeatInput.SILENT: (Move.NOTHING, Move.LEAVES, Move.NOTHING, Move.NOTHING),
    SeatInput.IDLE: (Move.NOTHING, Move.LEAVES, Move.NOTHING, Move.NOTHING),
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
        times: its time limits
    """

    def __init__(self, times: SeatTimes) -> None:
        self.holder = ""
        self.why = ""
        self.times = times
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
        return Standing.CLAIMANT if peer in self._claims else Standing.OTHER

    def holds(self, peer: str) -> bool:
        return self.standing(peer) is Standing.HOLDER

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
        if role == "observer":
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed"))
        return self._step(peer, SeatInput.REQUEST_IF_FREE if only_if_free else SeatInput.REQUEST, now)

    def take(self, peer: str, role: Role, now: float) -> SeatOutcome:
        if role != "supervisor":
            return SeatOutcome(refusal=SeatRefusal(peer, "not_allowed", "only a supervisor may take the seat"))
        return self._step(peer, SeatInput.TAKE, now)

    def answer(self, peer: str, claimant: str, now: float, *, grant: bool) -> SeatOutcome:
        """Take the answer of `peer` to the claim of `claimant`; ignore it if there is no such claim any more."""
        if not self.holds(peer):
            return SeatOutcome(refusal=SeatRefusal(peer, "no_seat", "only the holder of the seat may answer"))
        return self._step(claimant, SeatInput.GRANTED if grant else SeatInput.DECLINED, now)

    def release(self, peer: str, now: float) -> SeatOutcome:
        return self._step(peer, SeatInput.RELEASE, now)

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
        if self.holder and now - self._heard_at >= self._patience():
            yield self._step(self.holder, SeatInput.SILENT, now)
        if self.holder and now >= self._idle_at():
            yield self._step(self.holder, SeatInput.IDLE, now)
        for peer in [peer for peer, deadline in self._claims.items() if now >= deadline]:
            yield self._step(peer, SeatInput.UNANSWERED, now)
        if self.holder and not self._counting and now >= self._idle_at() - COUNTDOWN:
            self._counting = True
            yield SeatOutcome(changed=True)

    def _patience(self) -> float:
        """Return the seconds of silence after which the holder is gone."""
        return self.times.heartbeat + min(ROUND_TRIPS * self._round_trip, MOST_ROUND_TRIPS)

    # the moves

    def _step(self, peer: str, what: SeatInput, now: float) -> SeatOutcome:
        match TABLE[self.standing(peer), what]:
            case Move.NOTHING:
                return NOTHING
            case Move.SEATED:
                return self._seat(peer, what, now)
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

    def _seat(self, peer: str, what: SeatInput, now: float) -> SeatOutcome:
        """Give the seat to `peer`, or to nobody."""
        rest = bool(self.holder)
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
