"""A response that ends with the link that it was given to, even while it is being sent."""

import asyncio
from contextlib import suppress

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from lockstep.server.auth.tokens import Right
from lockstep.server.errors import ConsoleError

__all__ = ["EndingResponse"]

LOOK_SECONDS = 0.5


class EndingResponse(Response):
    """Sends `response` while `right` holds; then cuts the connection, so that nobody takes a part for the whole."""

    def __init__(self, response: Response, right: Right) -> None:
        super().__init__(status_code=response.status_code)
        self.response = response
        self.right = right

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        sending = asyncio.get_running_loop().create_task(self._send(scope, receive, send), name="answer")
        try:
            while not sending.done() and self._is_good():
                await asyncio.wait((sending,), timeout=LOOK_SECONDS)
        finally:
            ended = not sending.done()
            sending.cancel()
            with suppress(asyncio.CancelledError):
                await sending
            if ended:
                await _close_body(self.response)

    async def _send(self, scope: Scope, receive: Receive, send: Send) -> None:
        await self.response(scope, receive, send)

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
