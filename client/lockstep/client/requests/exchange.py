"""A request and its answer: a message that has changed the session as asked, or a refusal."""

import asyncio
from collections.abc import Awaitable, Callable

from lockstep.client.errors import ConsoleLost
from lockstep.client.session import Session
from lockstep.client.transport.transport import ChannelName, Transport
from lockstep.protocol.console import ClientMessage
from lockstep.protocol.messages import Refusal

__all__ = ["ANSWER_SECONDS", "Exchange", "Until"]

ANSWER_SECONDS = 5.0  # time for the console to answer a request

Until = Callable[[Callable[[], bool]], Awaitable[None]]  # waits until a message makes a condition true


class Exchange:
    """Asks the console. Ask one request at a time: a refusal does not name the request that it answers."""

    def __init__(self, transport: Transport, session: Session, until: Until) -> None:
        self._transport = transport
        self._session = session
        self._until = until

    async def ask(
        self,
        granted: Callable[[], bool],
        channel: ChannelName,
        message: ClientMessage,
        seconds: float = ANSWER_SECONDS,
    ) -> Refusal | None:
        """Send a request; return None if it was granted, otherwise the refusal.

        Raises:
            ConsoleLost: the connection ended, or neither came within `seconds`.
        """
        self._session.refusals.clear()
        self._transport.send(channel, message)
        try:
            async with asyncio.timeout(seconds):
                await self._until(lambda: granted() or bool(self._session.refusals))
        except TimeoutError:
            raise ConsoleLost(f"no answer from the console within {seconds:g} s") from None
        return None if granted() else self._session.refusals.popleft()
