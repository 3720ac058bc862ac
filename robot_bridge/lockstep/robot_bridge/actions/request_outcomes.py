"""Remembers the outcomes of requests for actions. No I/O, no clock: the caller hands in `now`."""

from collections import OrderedDict

from lockstep.protocol.actions import ActionUpdate

__all__ = ["MAX_REMEMBERED", "RequestOutcomes"]

MAX_REMEMBERED = 256  # requests whose outcome is known
TOLD_TO_NEWCOMERS = 16  # newest requests


class RequestOutcomes:
    """The newest update of each request, by its id. Call `make_room` before `add`."""

    def __init__(self, max_age: float) -> None:
        """`max_age`: s in which a copy of a request may still arrive."""
        self._max_age = max_age
        self._updates: OrderedDict[str, tuple[float, ActionUpdate]] = OrderedDict()  # by id, with the time of request

    def __contains__(self, id: object) -> bool:
        return id in self._updates

    def __getitem__(self, id: str) -> ActionUpdate:
        return self._updates[id][1]

    def add(self, update: ActionUpdate, now: float) -> None:
        """Remember the outcome of a request that arrived now."""
        self._updates[update.id] = now, update

    def replace(self, update: ActionUpdate) -> None:
        """Remember a newer update of a request."""
        self._updates[update.id] = self._updates[update.id][0], update

    def newest(self) -> list[ActionUpdate]:
        """Return the updates that a newcomer is told: all that run, and the newest others, oldest first."""
        known = [update for _, update in self._updates.values()]
        late = len(known) - TOLD_TO_NEWCOMERS
        return [each for index, each in enumerate(known) if index >= late or each.state == "running"]

    def make_room(self, now: float) -> bool:
        """Forget an outcome that no copy of its request can ask for any more. False if all may still be asked for."""
        while len(self._updates) >= MAX_REMEMBERED:
            oldest = next((id for id, (_, update) in self._updates.items() if update.state != "running"), "")
            if not oldest or now - self._updates[oldest][0] <= self._max_age:
                return False
            del self._updates[oldest]
        return True
