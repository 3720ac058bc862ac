"""The robots that called this console and were not let in, for people. No I/O, no clock.

Whoever reaches the console can be in it: addresses are true, names are what a robot calls itself.
"""

from collections import OrderedDict
from typing import Literal, NamedTuple

from lockstep.server.robot.pairing_offer import RefusalName
from lockstep.server.util.display_names import clean_name

__all__ = ["FORGOTTEN_AFTER", "MAX_WAITING", "WaitReason", "WaitingRobot", "WaitingRobots"]

MAX_WAITING = 8  # addresses
FORGOTTEN_AFTER = 60.0  # s without a try; a robot that waits dials again within 10 s

# By the names of the robot link: it has no key or another one, the place is taken by a robot with its key, or the
# reason why it was not paired.
WaitReason = RefusalName | Literal["robot_unknown", "taken"]


class WaitingRobot(NamedTuple):
    address: str
    since: float  # s since 1970, of its first try
    name: str  # what it called itself in the newest try that said so; "" if none has
    why: WaitReason  # of its newest try


class _Wait(NamedTuple):
    newest: float  # monotonic, s
    robot: WaitingRobot


class WaitingRobots:
    """At most `MAX_WAITING`, one an address. With more, the one that called longest ago is forgotten."""

    def __init__(self) -> None:
        self._waits: OrderedDict[str, _Wait] = OrderedDict()  # by address, in the order of their newest tries

    def called(self, address: str, why: WaitReason, name: str, now: float, wall: float) -> None:
        """Take a try that was refused, or that has to wait.

        Args:
            address: where it called from
            why: it was refused
            name: as it calls itself; "" if this try does not say, which leaves the name that is known
            now: monotonic, s
            wall: s since 1970, for people
        """
        self._forget(now)
        before = self._waits.pop(address, None)
        since, known = (wall, "") if before is None else (before.robot.since, before.robot.name)
        self._waits[address] = _Wait(now, WaitingRobot(address, since, clean_name(name, known), why))
        if len(self._waits) > MAX_WAITING:
            self._waits.popitem(last=False)

    def admitted(self, address: str) -> None:
        """Forget the robots of this address, because one of them was let in. Another one will call again."""
        self._waits.pop(address, None)

    def waiting(self, now: float) -> list[WaitingRobot]:
        """Return the robots that wait, by the time of their first try."""
        self._forget(now)
        return sorted((each.robot for each in self._waits.values()), key=lambda robot: robot.since)

    def _forget(self, now: float) -> None:
        while self._waits and now - next(iter(self._waits.values())).newest > FORGOTTEN_AFTER:
            self._waits.popitem(last=False)
