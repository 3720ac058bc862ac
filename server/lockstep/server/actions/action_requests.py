"""The requests for actions that were passed on, and the robot's answers."""

import asyncio
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass

from lockstep.protocol.actions import Act, ActionUpdate, ParameterValue
from lockstep.server.actions.action_states import aged
from lockstep.server.errors import ActionIdUsed, Unconfirmed

__all__ = ["ActionAnswer", "ActionRequests", "answered"]

REMEMBERED = 256  # newest requests, as many as the bridge remembers
ANSWER_SECONDS = 1.0  # for the robot to answer a request over HTTP

ActionAnswer = asyncio.Future[ActionUpdate | None]  # the first update, or None if the bridge ended without one


@dataclass(slots=True)
class _Asked:
    name: str
    parameters: Mapping[str, ParameterValue]
    answer: ActionAnswer | None  # None: it came on a data channel
    newest: ActionUpdate | None = None
    since: float = 0.0  # monotonic, s, when the action came to the state of `newest`


class ActionRequests:
    """The newest requests, by id. `now` is s on a monotonic clock."""

    def __init__(self) -> None:
        self._asked: OrderedDict[str, _Asked] = OrderedDict()  # oldest first

    def __contains__(self, id: str) -> bool:
        return id in self._asked

    def add(self, act: Act, answer: ActionAnswer | None) -> None:
        """Note a request that was passed on; the first with its id counts."""
        if act.id not in self._asked:
            self._asked[act.id] = _Asked(act.name, act.parameters, answer)
            if len(self._asked) > REMEMBERED:
                self._asked.popitem(last=False)

    def updated(self, update: ActionUpdate, now: float) -> None:
        """Take the robot's news of an action."""
        asked = self._asked.get(update.id)
        if asked is not None:
            if asked.newest is None or asked.newest.state != update.state:
                asked.since = now - update.age
            asked.newest = update
            if asked.answer is not None and not asked.answer.done():
                asked.answer.set_result(update)

    def newest(self, id: str, now: float) -> ActionUpdate | None:
        """Return the newest update of a request, with its age; None: there is none, or the request is unknown."""
        asked = self._asked.get(id)
        return None if asked is None or asked.newest is None else aged(asked.newest, asked.since, now)

    async def again(self, id: str, name: str, parameters: Mapping[str, ParameterValue], now: float) -> ActionUpdate:
        """Answer a repeated request from memory.

        Raises:
            ActionIdUsed: an earlier request with this id asked for something else.
            Unconfirmed: the robot has not answered.
        """
        asked = self._asked.get(id)
        if asked is None or asked.answer is None or (asked.name, asked.parameters) != (name, parameters):
            raise ActionIdUsed("an earlier request with this id asked for something else, or on another way")
        return self.newest(id, now) or await answered(asked.answer)

    def clear(self) -> None:
        """Forget all, and tell everyone who waits that no answer comes."""
        for asked in self._asked.values():
            if asked.answer is not None and not asked.answer.done():
                asked.answer.set_result(None)
        self._asked.clear()


async def answered(answer: ActionAnswer) -> ActionUpdate:
    """Wait for the robot's answer. Raises Unconfirmed."""
    try:
        async with asyncio.timeout(ANSWER_SECONDS):
            update = await asyncio.shield(answer)  # a repeat of the request waits for the same answer
    except TimeoutError:
        raise Unconfirmed("the robot has not answered yet; GET /api/actions shows whether it does") from None
    if update is None:
        raise Unconfirmed("the robot bridge ended before it answered")
    return update
