"""The offer of the control seat to policies: who may make it, whom it lets drive, and when it ends. No I/O, no clock.

A policy drives only within an offer, on the responsibility of the person who made it. One offer is good for one turn:

| the offer is made by | while |
|---|---|
| the person who holds the seat, which that frees | nobody else asks for the seat |
| any operator or supervisor | the seat is free, or a policy drives (who then is responsible from now on) |

It ends, and with it the turn of the policy that drives, when

- a person takes the seat, or any operator or supervisor withdraws the offer,
- somebody stops the robot, or the robot link is lost,
- the last connection of the link that made it has ended, or all of them are silent for as long as the seat's holder
  may be: that person is gone, cannot see the robot, or no longer has the right,
- the policy leaves the seat, for whatever reason,
- no policy has taken the seat within the time in which a request for the seat is answered.

There is no offer when the console starts.
"""

from typing import NamedTuple

__all__ = ["Offer"]


class Offer(NamedTuple):
    """An offer that holds."""

    by: str  # the peer that made it
    link: str  # the link of that peer
    to: str  # the only policy that may take the seat, a peer; "": any
    until: float  # s, monotonic; end of the offer unless a policy has the seat by then

    def admits(self, policy: str) -> bool:
        return self.to in ("", policy)
