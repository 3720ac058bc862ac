"""The control seat: who may drive. No I/O, no clock.

At most one peer holds the seat. It never stays with a peer that is gone or silent, and whenever it is given up
the robot rests. A peer is seen as HOLDER, or as OTHER while somebody else holds the seat, or the seat is FREE.

| seat, to this peer | request | release | gone | silent |
|---|---|---|---|---|
| FREE | takes it | – | – | – |
| HOLDER | keeps it | free, rest | free, rest | free, rest |
| OTHER | refused seat_taken | – | – | – |

A request by a role that may not drive is refused `not_allowed` before the table is asked.
"""

from enum import Enum
from typing import NamedTuple

from robot_bridge.protocol.console import Role, Seat
from robot_bridge.protocol.messages import RefusalReason

__all__ = ["ControlSeat", "SeatInput", "SeatOutcome", "Standing"]


class Standing(Enum):
    FREE = "free"
    HOLDER = "holder"
    OTHER = "other"


class SeatInput(Enum):
    REQUEST = "request"
    RELEASE = "released"
    GONE = "disconnected"
    SILENT = "heartbeat lost"


class SeatOutcome(NamedTuple):
    """What follows from an input: tell everyone, rest the robot, or refuse. All false: nothing."""

    changed: bool = False
    rest: bool = False
    refusal: RefusalReason | None = None


NOTHING = SeatOutcome()
TAKEN = SeatOutcome(changed=True)
FREED = SeatOutcome(changed=True, rest=True)

TABLE: dict[tuple[Standing, SeatInput], SeatOutcome] = {
    (Standing.FREE, SeatInput.REQUEST): TAKEN,
    (Standing.FREE, SeatInput.RELEASE): NOTHING,
    (Standing.FREE, SeatInput.GONE): NOTHING,
    (Standing.FREE, SeatInput.SILENT): NOTHING,
    (Standing.HOLDER, SeatInput.REQUEST): NOTHING,
    (Standing.HOLDER, SeatInput.RELEASE): FREED,
    (Standing.HOLDER, SeatInput.GONE): FREED,
    (Standing.HOLDER, SeatInput.SILENT): FREED,
    (Standing.OTHER, SeatInput.REQUEST): SeatOutcome(refusal="seat_taken"),
    (Standing.OTHER, SeatInput.RELEASE): NOTHING,
    (Standing.OTHER, SeatInput.GONE): NOTHING,
    (Standing.OTHER, SeatInput.SILENT): NOTHING,
}


class ControlSeat:
    """The seat's state. `now` is monotonic seconds, handed in.

    Call `heard` for every valid message of a peer, and `expire` a few times a second.
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._heard_at = 0.0
        self.seat = Seat()

    def standing(self, peer: str) -> Standing:
        if not self.seat.holder:
            return Standing.FREE
        return Standing.HOLDER if self.seat.holder == peer else Standing.OTHER

    def holds(self, peer: str) -> bool:
        return self.standing(peer) is Standing.HOLDER

    def request(self, peer: str, name: str, role: Role, now: float) -> SeatOutcome:
        if role != "operator":
            return SeatOutcome(refusal="not_allowed")
        outcome = self._step(peer, SeatInput.REQUEST)
        if outcome.changed:
            self.seat = Seat(holder=peer, name=name, why=SeatInput.REQUEST.value)
            self._heard_at = now
        return outcome

    def release(self, peer: str) -> SeatOutcome:
        return self._step(peer, SeatInput.RELEASE)

    def gone(self, peer: str) -> SeatOutcome:
        return self._step(peer, SeatInput.GONE)

    def heard(self, peer: str, now: float) -> None:
        if self.holds(peer):
            self._heard_at = now

    def expire(self, now: float) -> SeatOutcome:
        if not self.seat.holder or now - self._heard_at < self._timeout:
            return NOTHING
        return self._step(self.seat.holder, SeatInput.SILENT)

    def _step(self, peer: str, what: SeatInput) -> SeatOutcome:
        outcome = TABLE[self.standing(peer), what]
        if outcome.rest:
            self.seat = Seat(why=what.value)
        return outcome
