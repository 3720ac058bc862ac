"""A response that ends with the link that it was given to, even while it is being sent."""

import asyncio

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from lockstep.server.auth.tokens import Right
from lockstep.server.errors import ConsoleError
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["EndingResponse"]

LOOK_SECONDS = 0.5


class EndingResponse(Response):
    """Sends `response` while `right` holds; then cuts the connection, so that nobody takes a part for the whole."""

    def __init__(self, response: Response, right: Right) -> None:
        super().__init__(status_code=response.status_code)
        self.response = response
        self.right = right

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        whole = False
        try:
            async with asyncio.timeout(None) as bound, background_tasks(self._cut(bound)):
                if self._is_good():
                    await self.response(scope, receive, send)
                    whole = True
        except TimeoutError:
            if not bound.expired():
                raise
        finally:
            if not whole:
                await _close_body(self.response)

    async def _cut(self, sending: asyncio.Timeout) -> None:
        """End the sending once the link has ended."""
        while True:
            await asyncio.sleep(LOOK_SECONDS)
            if not self._is_good():
                sending.reschedule(asyncio.get_running_loop().time())
                return

    def _is_good(self) -> bool:
        try:
            return self.right.identity is not None
        except ConsoleError:
            return False


async def _close_body(response: Response) -> None:
    """Close the file that a body is read from; `response` does so only when it has read it to its end."""
    close = getattr(getattr(response, "body_iterator", None), "aclose", None)
    if close is not None:
        await close()
