"""A session with a Janus that answers, refuses, keeps silent, talks nonsense, and goes away."""

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from websockets.asyncio.server import ServerConnection, serve
from websockets.typing import Subprotocol

from lockstep.protocol.janus import Heard
from lockstep.server.sfu import janus_session
from lockstep.server.sfu.errors import RelayRefused, RelaySilent, RelayUnreachable
from lockstep.server.sfu.janus_session import open_janus
from tests.support.websockets_made import keep_websockets

Answer = Callable[[ServerConnection, dict[str, Any]], Awaitable[None]]


@asynccontextmanager
async def janus(answer: Answer) -> AsyncIterator[str]:
    """Answers `create` and `attach` itself and leaves the rest to `answer`."""

    async def talk(socket: ServerConnection) -> None:
        async for text in socket:
            request = json.loads(text)
            if request["janus"] in ("create", "attach"):
                said = {"janus": "success", "transaction": request["transaction"], "data": {"id": 11}}
                await socket.send(json.dumps(said))
            else:
                await answer(socket, request)

    async with serve(talk, "127.0.0.1", 0, subprotocols=[Subprotocol("janus-protocol")]) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        yield f"ws://127.0.0.1:{port}"


async def _event(socket: ServerConnection, request: dict[str, Any]) -> None:
    """As Janus does: an acknowledgement first, then the plugin's answer."""
    await socket.send(json.dumps({"janus": "ack", "transaction": request["transaction"]}))
    data = {"plugindata": {"data": {"videoroom": "event", "asked": request["body"]["request"]}}}
    await socket.send(json.dumps({"janus": "event", "sender": 11, "transaction": request["transaction"], **data}))


def _ignore(_: Heard) -> None:
    pass


async def test_a_request_is_answered_by_the_plugin_not_by_the_acknowledgement() -> None:
    async with janus(_event) as url, open_janus(url) as session:
        handle = await session.attach(_ignore)
        heard = await session.message(handle, {"request": "exists"})
    assert heard.data["asked"] == "exists"


async def test_a_refusal_has_the_reason_and_the_code() -> None:
    async def refuse(socket: ServerConnection, request: dict[str, Any]) -> None:
        error = {"error_code": 433, "error": "Unauthorized"}
        said = {"janus": "event", "transaction": request["transaction"], "plugindata": {"data": error}}
        await socket.send(json.dumps(said))

    async with janus(refuse) as url, open_janus(url) as session:
        handle = await session.attach(_ignore)
        with pytest.raises(RelayRefused, match="Unauthorized") as raised:
            await session.message(handle, {"request": "join"})
    assert raised.value.code == 433


async def test_a_relay_that_does_not_answer_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    async def nothing(socket: ServerConnection, request: dict[str, Any]) -> None:
        pass

    async with janus(nothing) as url, open_janus(url) as session:
        handle = await session.attach(_ignore)
        monkeypatch.setattr(janus_session, "ANSWER_SECONDS", 0.05)  # from here on: a busy machine is slow to connect
        with pytest.raises(RelaySilent):
            await session.message(handle, {"request": "join"})


async def test_a_relay_that_hangs_up_fails_what_is_asked_and_all_that_follows() -> None:
    async def hang_up(socket: ServerConnection, request: dict[str, Any]) -> None:
        await socket.close()

    async with janus(hang_up) as url, open_janus(url) as session:
        handle = await session.attach(_ignore)
        with pytest.raises(RelayUnreachable):
            await session.message(handle, {"request": "join"})
        async with asyncio.timeout(20):
            await session.ended.wait()
        with pytest.raises(RelayUnreachable):
            await session.message(handle, {"request": "join"})


async def test_nonsense_is_counted_and_disturbs_nothing() -> None:
    async def babble(socket: ServerConnection, request: dict[str, Any]) -> None:
        await socket.send("no json")
        await socket.send('{"janus": {}}')
        await _event(socket, request)

    async with janus(babble) as url, open_janus(url) as session:
        handle = await session.attach(_ignore)
        heard = await session.message(handle, {"request": "exists"})
        assert session.malformed == 2
    assert heard.data["asked"] == "exists"


async def test_events_that_answer_nothing_go_to_the_handle_that_they_are_about() -> None:
    heard: list[Heard] = []

    async def hang_up_media(socket: ServerConnection, request: dict[str, Any]) -> None:
        await socket.send(json.dumps({"janus": "hangup", "sender": 11, "reason": "ICE failed"}))
        await _event(socket, request)

    async with janus(hang_up_media) as url, open_janus(url) as session:
        handle = await session.attach(heard.append)
        await session.message(handle, {"request": "exists"})
    assert [(each.kind, each.detail) for each in heard] == [("ended", "ICE failed")]


async def test_where_nobody_listens_a_relay_is_unreachable() -> None:
    async with janus(_event) as url:
        pass
    with pytest.raises(RelayUnreachable):
        async with open_janus(url):
            pass


async def test_a_relay_that_does_not_answer_the_close_keeps_no_connection_open(monkeypatch: pytest.MonkeyPatch) -> None:
    made, opened = keep_websockets(monkeypatch, janus_session), asyncio.Event()

    async def hold(url: str) -> None:
        async with open_janus(url):
            made[0].transport.pause_reading()
            opened.set()
            await asyncio.Event().wait()

    async with janus(_event) as url:
        holding = asyncio.create_task(hold(url))
        async with asyncio.timeout(20):
            await opened.wait()
            while not holding.done():  # the first cancellation begins the close, and the next ones end it
                holding.cancel()
                await asyncio.sleep(0)
        assert made[0].transport.is_closing()
