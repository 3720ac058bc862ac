"""How the newest actions do. No I/O, no clock: `now` is s on a monotonic clock."""

from collections import OrderedDict

import msgspec

from lockstep.protocol.actions import ActionUpdate

__all__ = ["KEPT", "ActionStates", "aged"]

KEPT = 32  # newest actions whose state newcomers are told


class ActionStates:
    """The newest update of each action, and which of them are told later."""

    def __init__(self) -> None:
        # By id of the request, oldest first: when the action came to its state, in s, and its update without an age.
        self._updates: OrderedDict[str, tuple[float, ActionUpdate]] = OrderedDict()
        self._owed: dict[str, None] = {}  # ids in `_updates` of which a new state came too fast and is told later

    def get(self, id: str) -> ActionUpdate | None:
        """Return the newest update of an action, without its age."""
        kept = self._updates.get(id)
        return None if kept is None else kept[1]

    def newest(self, now: float) -> list[ActionUpdate]:
        """Return how the actions do, oldest first, with the age of each that has ended."""
        return [aged(update, since, now) for since, update in self._updates.values()]

    def keep(self, update: ActionUpdate, now: float) -> None:
        """Keep an update, and forget the oldest beyond a bound: those that have ended and were told first."""
        since, before = self._updates.get(update.id, (0.0, None))
        if before is None or before.state != update.state:
            since = now - update.age
        self._updates[update.id] = since, msgspec.structs.replace(update, age=0.0)
        if len(self._updates) > KEPT:
            ended = (id for id, (_, each) in self._updates.items() if each.state != "running")
            evicted = next((id for id in ended if id not in self._owed), next(iter(self._updates)))
            del self._updates[evicted]
            self._owed.pop(evicted, None)

    def owe(self, update: ActionUpdate, now: float) -> None:
        """Keep an update that is told later."""
        self._owed[update.id] = None  # before `keep`, which could otherwise evict this very update
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
        since, update = self._updates[id]
        return aged(update, since, now)

    def clear(self) -> None:
        self._updates.clear()
        self._owed.clear()


def aged(update: ActionUpdate, since: float, now: float) -> ActionUpdate:
    """Return an update with its age as of now. `since`: when the action came to its state, in s."""
    if update.state == "running":
        return update
    return msgspec.structs.replace(update, age=max(0.0, now - since))
