import asyncio
from collections.abc import AsyncGenerator
from contextlib import aclosing

import pytest
from starlette.responses import Response, StreamingResponse
from starlette.types import Message

from lockstep.server.auth.tokens import Identity, Right
from lockstep.server.errors import LinkRevoked
from lockstep.server.http import ending_response
from lockstep.server.http.ending_response import EndingResponse

SCOPE = {"type": "http", "method": "GET", "path": "/", "headers": [], "asgi": {"spec_version": "2.4"}}


class _Link:
    """A link that is revoked by hand."""

    def __init__(self) -> None:
        self.revoked = False

    def check(self, identity: Identity) -> None:
        if self.revoked:
            raise LinkRevoked("this link was revoked")

    @property
    def right(self) -> Right:
        return Right(Identity("operator", "Ada", "a", 1.0), self.check)


async def _never() -> Message:
    await asyncio.Event().wait()
    raise AssertionError


async def test_an_answer_under_way_ends_with_its_link(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ending_response, "LOOK_SECONDS", 0.01)
    link, sent, closed = _Link(), list[Message](), asyncio.Event()

    async def body() -> AsyncGenerator[bytes]:
        try:
            while True:
                yield b"chunk"
                await asyncio.sleep(0)
        finally:
            closed.set()

    async def send(message: Message) -> None:
        sent.append(message)
        if len(sent) == 3:
            link.revoked = True
        if len(sent) > 3:
            await asyncio.Event().wait()  # the remote does not read any more

    async with asyncio.timeout(20), aclosing(body()) as chunks:
        await EndingResponse(StreamingResponse(chunks), link.right)(SCOPE, _never, send)
        assert closed.is_set()
    assert sent[0]["type"] == "http.response.start"
    assert all(message.get("more_body") for message in sent[1:]), "it never says that this was all"


async def test_an_answer_whose_link_is_good_comes_whole() -> None:
    sent: list[Message] = []

    async def send(message: Message) -> None:
        sent.append(message)

    await EndingResponse(Response(b"whole"), _Link().right)(SCOPE, _never, send)
    assert (sent[-1]["body"], sent[-1].get("more_body", False)) == (b"whole", False)


async def test_what_goes_wrong_with_an_answer_comes_out() -> None:
    async def send(message: Message) -> None:
        raise OSError("gone")

    with pytest.raises(OSError, match="gone"):
        await EndingResponse(Response(b"whole"), _Link().right)(SCOPE, _never, send)
