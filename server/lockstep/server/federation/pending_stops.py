"""Tracks STOPs for robots of other consoles: requests and answers. No I/O, no clock."""

import asyncio
from collections import OrderedDict

from lockstep.server.federation.board import StopAnswer
from lockstep.server.federation.messages import Outcome, StopReply, StopRequest

__all__ = ["Asked", "PendingStops"]

MAX_REMEMBERED = 256  # requests that were obeyed; a repeat of one is answered, not obeyed again
NOT_SAID = "its console could not deliver the stop and gives no reason"


class Asked:
    """A request of this console, until all have answered or nobody waits any more."""

    def __init__(self, request: StopRequest) -> None:
        self.request = request
        self.answers: dict[str, StopAnswer] = {}
        self.complete = asyncio.Event()

    def answered(self, reply: StopReply) -> None:
        """Take a reply. Of two answers for one robot the worse counts: two consoles claim the robot."""
        for each in reply.robots:
            known = self.answers.get(each.robot)
            if each.robot in self.request.robots and (known is None or known.delivered):
                detail = "" if each.delivered else each.detail or NOT_SAID
                self.answers[each.robot] = StopAnswer(True, each.delivered, each.event, detail, each.number, each.kept)
        if len(self.answers) == len(self.request.robots):
            self.complete.set()


class PendingStops:
    def __init__(self) -> None:
        self._asked: dict[str, Asked] = {}
        self._obeyed: OrderedDict[str, tuple[Outcome, ...] | None] = OrderedDict()  # None: being carried out

    @property
    def waiting(self) -> int:
        return len(self._asked)

    def ask(self, request: StopRequest) -> Asked:
        asked = self._asked[request.request] = Asked(request)
        return asked

    def end(self, asked: Asked) -> None:
        self._asked.pop(asked.request.request, None)

    def replied(self, reply: StopReply) -> None:
        asked = self._asked.get(reply.request)
        if asked is not None:
            asked.answered(reply)

    def is_new(self, request: StopRequest) -> bool:
        """Return whether to carry out a request: a repeated one is carried out once. Then call `obeyed`."""
        if request.request in self._obeyed:
            return False
        self._obeyed[request.request] = None
        while len(self._obeyed) > MAX_REMEMBERED:
            self._obeyed.popitem(last=False)
        return True

    def obeyed(self, request: StopRequest, outcomes: tuple[Outcome, ...]) -> None:
        if request.request in self._obeyed:
            self._obeyed[request.request] = outcomes

    def outcomes(self, request: StopRequest) -> tuple[Outcome, ...]:
        """Return the outcomes of a request; empty while it is being carried out."""
        return self._obeyed.get(request.request) or ()
