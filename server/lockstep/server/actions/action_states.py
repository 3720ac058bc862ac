"""How the newest actions do. No I/O, no clock: `now` is s on a monotonic clock."""

from collections import OrderedDict

import msgspec

from lockstep.protocol.actions import ActionUpdate

__all__ = ["KEPT", "ActionStates"]

KEPT = 32  # newest actions whose state newcomers are told


class ActionStates:
    """The newest update of each action, and which of them are told later."""

    def __init__(self) -> None:
        # By id of the request, oldest first; without their age, which changes.
        self._updates: OrderedDict[str, ActionUpdate] = OrderedDict()
        self._since: dict[str, float] = {}  # of the same ids: s, when the action came to its state
        self._owed: dict[str, None] = {}  # ids in `_updates` of which a new state came too fast and is told later

    def get(self, id: str) -> ActionUpdate | None:
        """Return the newest update of an action, without its age."""
        return self._updates.get(id)

    def newest(self, now: float) -> list[ActionUpdate]:
        """Return how the actions do, oldest first, with the age of each that has ended."""
        return [self._aged(each, now) for each in self._updates.values()]

    def keep(self, update: ActionUpdate, now: float) -> None:
        """Keep an update, and forget the oldest beyond a bound: those that have ended and were told first."""
        before = self._updates.get(update.id)
        if before is None or before.state != update.state:
            self._since[update.id] = now - update.age
        self._updates[update.id] = msgspec.structs.replace(update, age=0.0)
        if len(self._updates) > KEPT:
            told = (id for id, each in self._updates.items() if each.state != "running" and id not in self._owed)
            evicted = next(told, next(iter(self._updates)))
            del self._updates[evicted], self._since[evicted]
            self._owed.pop(evicted, None)

    def owe(self, update: ActionUpdate, now: float) -> None:
        """Keep an update that is told later."""
        self._owed[update.id] = None  # first, else it could be forgotten for the room of its own
        self.keep(update, now)

    def owes(self, id: str) -> bool:
        return id in self._owed

    @property
    def is_owing(self) -> bool:
        return bool(self._owed)

    def take_owed(self, now: float) -> ActionUpdate:
        """Return the newest update of the action that waits longest to be told."""
        id = next(iter(self._owed))
        del self._owed[id]
        return self._aged(self._updates[id], now)

    def clear(self) -> None:
        self._updates.clear()
        self._since.clear()
        self._owed.clear()

    def _aged(self, update: ActionUpdate, now: float) -> ActionUpdate:
        """Return an update that was kept with its age as of now."""
        if update.state == "running":
            return update
        return msgspec.structs.replace(update, age=max(0.0, now - self._since[update.id]))
