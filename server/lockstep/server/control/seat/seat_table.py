"""The table of the control seat, the right to drive.

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
"""

from enum import Enum
from typing import NamedTuple

from lockstep.protocol.messages import RefusalReason

__all__ = ["NOTHING", "OFFER_ENDS", "TABLE", "Move", "SeatInput", "SeatOutcome", "SeatRefusal", "Standing"]


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
    STOPPED = "stopped"  # no policy moves it again before a person says so
    LINK_LOST = "robot link lost"  # nobody knows what has changed there
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
