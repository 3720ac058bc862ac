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

_QUOTES = str.maketrans(dict.fromkeys("\"'`´‘’‚‛“”„‟«»‹›"))  # people see a name between such

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
    """At most `MAX_WAITING`, one an address. With more, the one that called longest ago is forgotten.

    Robots with the paired robot's key are apart, as many again: no stranger makes them forgotten.
    """

    def __init__(self) -> None:
        # By address, in the order of their newest tries.
        self._strangers: OrderedDict[str, _Wait] = OrderedDict()
        self._taken: OrderedDict[str, _Wait] = OrderedDict()

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
        waits = self._taken if why == "taken" else self._strangers
        before = waits.pop(address, None)
        since, known = (wall, "") if before is None else (before.robot.since, before.robot.name)
        waits[address] = _Wait(now, WaitingRobot(address, since, clean_name(name.translate(_QUOTES), known), why))
        if len(waits) > MAX_WAITING:
            waits.popitem(last=False)

    def admitted(self, address: str) -> None:
        """Forget the robots of this address, because one of them was let in. Another one will call again."""
        for waits in (self._strangers, self._taken):
            waits.pop(address, None)

    def waiting(self, now: float) -> list[WaitingRobot]:
        """Return the robots that wait, by the time of their first try."""
        self._forget(now)
        waits = (*self._strangers.values(), *self._taken.values())
        return sorted((each.robot for each in waits), key=lambda robot: robot.since)

    def _forget(self, now: float) -> None:
        for waits in (self._strangers, self._taken):
            while waits and now - next(iter(waits.values())).newest > FORGOTTEN_AFTER:
                waits.popitem(last=False)
