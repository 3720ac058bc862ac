"""Requests wait for their turn: a salvo of them must not stand before the operator's messages."""

import asyncio
from collections import deque

__all__ = ["RequestTurns"]


class RequestTurns:
    """One request in each turn of the loop; addresses take turns, and each one's requests keep their order.

    Its bound is that of connections, since each has one request under way.
    """

    def __init__(self) -> None:
        self._is_free = True  # in this turn of the loop
        self._waiting: dict[str, deque[asyncio.Future[None]]] = {}  # by address, the next first

    async def take(self, address: str) -> None:
        """Returns when it is this request's turn: at once if there was no other in this turn of the loop."""
        loop = asyncio.get_running_loop()
        if self._is_free:
            self._is_free = False
            loop.call_soon(self._pass_on)
            return
        turn: asyncio.Future[None] = loop.create_future()
        self._waiting.setdefault(address, deque()).append(turn)
        await turn

    def _pass_on(self) -> None:
        while self._waiting:
            address = next(iter(self._waiting))
            queue = self._waiting.pop(address)
            turn = queue.popleft()
            if queue:
                self._waiting[address] = queue  # behind the others
            if not turn.done():  # who waited for it may be gone
                turn.set_result(None)
                asyncio.get_running_loop().call_soon(self._pass_on)
                return
        self._is_free = True
