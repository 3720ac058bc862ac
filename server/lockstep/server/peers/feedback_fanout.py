"""Sends feedback: to the driver at once, to others who may drive in slices, to observers also at a bounded rate.

All but the driver get only the newest. The more observers there are, the less often each is served, down to half the
rate.

`FeedbackPace` times it; `FeedbackFanout` sends. Sending to a peer costs a fraction of a millisecond in Python, so a
hundred peers are served in small slices, and the operator's commands are handled between them.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

from lockstep.server.util.cooperative_scheduler import turns_of_loop

__all__ = ["FeedbackFanout", "FeedbackPace", "FeedbackReceiver"]

FULL_RATE = 50  # observers that are served at the full rate
LEAST_RATE = 0.5  # of the full rate


class FeedbackReceiver(Protocol):
    """The part of a peer that the fan-out needs."""

    def send_feedback(self, text: str) -> None: ...


class FeedbackPace:
    """Paces the newest feedback to the observers: at most `rate` times a second. No I/O."""

    def __init__(self, rate: float) -> None:
        self._shortest = 1 / rate
        self._interval = self._shortest
        self._next_at = 0.0
        self._newest: str | None = None

    def offer(self, text: str) -> None:
        self._newest = text

    def share(self, observers: int) -> None:
        """Set the number of observers that share the rate."""
        self._interval = self._shortest / max(LEAST_RATE, min(1.0, FULL_RATE / max(1, observers)))

    def wait(self, now: float) -> float | None:
        """Return the seconds until something is due; None if nothing waits."""
        return None if self._newest is None else max(0.0, self._next_at - now)

    def take(self, now: float) -> str | None:
        """Return the newest feedback if it is due, else None."""
        if self._newest is None or now < self._next_at:
            return None
        text, self._newest = self._newest, None
        # Counted from when it was due, so that late timers do not lower the rate; after a pause, from now.
        due = self._next_at if now - self._next_at < self._interval else now
        self._next_at = due + self._interval
        return text


Operator = TypeVar("Operator", bound=FeedbackReceiver)


class FeedbackFanout(Generic[Operator]):
    """Run `run` as a task; call `publish` for every feedback."""

    def __init__(
        self,
        rate: float,
        drives: Callable[[Operator], bool],
        operators: Callable[[], Sequence[Operator]],
        observers: Callable[[], Sequence[FeedbackReceiver]],
        relays: Sequence[FeedbackReceiver] = (),
    ) -> None:
        """`drives` returns whether one of the `operators` drives; one link may have a hundred that do not.

        `relays`: each gets what an observer gets, once for all of its watchers.
        """
        self._pace = FeedbackPace(rate)
        self._drives = drives
        self._operators = operators
        self._observers = observers
        self._relays = relays
        self._offered = asyncio.Event()
        self._newest = ""
        self._behind: dict[Operator, None] = {}  # operators that have not got the newest yet, in order
        self._asked = False  # True while a turn of the loop is requested

    def publish(self, text: str) -> None:
        self._newest = text
        for peer in self._operators():
            if self._drives(peer):
                peer.send_feedback(text)
                self._behind.pop(peer, None)
            else:
                self._behind[peer] = None
        self._ask()
        self._pace.offer(text)
        self._offered.set()

    def _ask(self) -> None:
        if self._behind and not self._asked:
            self._asked = True
            turns_of_loop().ask(self._serve_operators)

    def _serve_operators(self) -> None:
        self._asked = False
        turns = turns_of_loop()
        try:
            while self._behind:
                peer = next(iter(self._behind))
                del self._behind[peer]
                peer.send_feedback(self._newest)
                if turns.is_over():
                    break
        finally:
            self._ask()

    async def run(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await self._offered.wait()
            self._offered.clear()
            while (wait := self._pace.wait(loop.time())) is not None:
                if wait > 0:
                    await asyncio.sleep(wait)
                text = self._pace.take(loop.time())
                if text is not None:
                    await self._serve(text)

    async def _serve(self, text: str) -> None:
        turns = turns_of_loop()
        waiting = deque([*self._relays, *self._observers()])
        self._pace.share(len(waiting))
        served = asyncio.get_running_loop().create_future()

        def serve_some() -> None:
            try:
                while waiting:
                    waiting.popleft().send_feedback(text)
                    if turns.is_over():
                        break
            except Exception as error:
                if not served.done():
                    served.set_exception(error)
                return
            if waiting and not served.done():
                turns.ask(serve_some)
            elif not served.done():
                served.set_result(None)

        turns.ask(serve_some)
        await served
