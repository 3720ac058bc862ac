"""The headless client's line to the console, and what it does where none can be opened."""

import asyncio
import datetime
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import InvalidStatus
from websockets.protocol import State

from lockstep.client.console_url import ConsoleLink, parse_link
from lockstep.client.errors import ConnectFailed, SignallingRefused
from lockstep.client.transport.websocket_transport import WebSocketBlocked, WebSocketTransport
from lockstep.client.transport.whep import Whep
from lockstep.protocol.console import Welcome, decode_server_message
from lockstep.protocol.messages import Ping, Pong, Stop
from lockstep.server.http.transport.tls import self_signed
from tests.server.fleet.rig import running_fleet_rig
from tests.server.rig import PATIENCE, eventually, running_bridge, running_console, running_rig
from tests.server.watch_lines import NOWHERE

RELAYED: dict[str, Any] = {"relay": NOWHERE, "observers_direct": 0}


class _Heard:
    def __init__(self) -> None:
        self.messages: list[Any] = []

    def take(self, data: str | bytes) -> None:
        self.messages.append(decode_server_message(data))

    def has(self, kind: type) -> bool:
        return any(isinstance(each, kind) for each in self.messages)


def _line(link: ConsoleLink, heard: _Heard) -> WebSocketTransport:
    return WebSocketTransport(link, "0", None, heard.take, PATIENCE)


@asynccontextmanager
async def _open(line: WebSocketTransport) -> AsyncIterator[None]:
    """Runs the line until it ends or the test is over."""
    try:
        assert await line.negotiate() == []
        await line.connect(PATIENCE)
        async with asyncio.TaskGroup() as tasks:
            running = tasks.create_task(line.run())
            yield
            running.cancel()
    finally:
        await line.close()


async def test_a_line_is_welcomed_asks_stops_and_says_how_it_ended() -> None:
    heard = _Heard()
    async with running_rig(**RELAYED) as rig:
        line = _line(parse_link(f"{rig.url}/#token={rig.access.issue('observer', 'ann')}"), heard)
        async with _open(line):
            await eventually(lambda: heard.has(Welcome))
            line.send("control", Ping(id=5))
            await eventually(lambda: Pong(id=5) in heard.messages)
            line.send("stop", Stop(reason="seen"))
            await eventually(lambda: rig.dependencies.console.clock.stop.stopped)
            with pytest.raises(ConnectFailed, match="TCP"):
                await line.restart_ice(1.0)
            next(iter(rig.dependencies.console.peers)).end("link revoked")
            async with asyncio.timeout(PATIENCE):
                await line.ended.wait()
            assert line.why == "the console closed the connection (link revoked)"
            line.send("control", Ping(id=6))
        await line.close()


async def test_a_refusal_is_no_blocked_line() -> None:
    async with running_rig(**RELAYED, max_relayed=1, reserved_places=0) as rig:
        link = parse_link(f"{rig.url}/#token={rig.access.issue('observer', 'ann')}")
        first, second = _line(link, _Heard()), _line(link, _Heard())
        try:
            await first.negotiate()
            with pytest.raises(SignallingRefused) as refused:
                await second.negotiate()
            assert refused.value.error == "too_many_peers"
        finally:
            await first.close()
            await second.close()


async def test_where_no_websocket_passes_the_ticket_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    def blocked(*_: object, **__: object) -> None:
        raise ConnectionRefusedError("a proxy")

    monkeypatch.setattr("lockstep.client.transport.websocket_transport.connect", blocked)
    async with running_rig(**RELAYED) as rig:
        line = _line(parse_link(f"{rig.url}/#token={rig.access.issue('observer', 'ann')}"), _Heard())
        try:
            with pytest.raises(WebSocketBlocked, match="a proxy"):
                await line.negotiate()
            await eventually(lambda: len(rig.dependencies.console.peers) == 0)
            assert rig.count("lockstep_peers_ended_total", why="deleted") == 1
        finally:
            await line.close()


@pytest.mark.parametrize("status", [404, 405])
async def test_a_console_that_knows_no_lines_counts_as_blocked(monkeypatch: pytest.MonkeyPatch, status: int) -> None:
    async def unknown(*_: object) -> str:
        raise SignallingRefused(status, "", "")

    monkeypatch.setattr(Whep, "watch", unknown)
    line = _line(parse_link("http://127.0.0.1:9/#token=x"), _Heard())
    with pytest.raises(WebSocketBlocked):
        await line.negotiate()
    await line.close()


async def test_a_console_that_answers_no_ping_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:

    async def ticket(*_: object) -> str:
        return "t"

    async def listen(socket: ServerConnection) -> None:
        async for _ in socket:
            pass  # takes all, says nothing

    monkeypatch.setattr(Whep, "watch", ticket)
    async with serve(listen, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        line = WebSocketTransport(parse_link(f"http://127.0.0.1:{port}/#token=x"), "0", None, _Heard().take, 0.05)
        async with _open(line):
            line.send("control", Ping(id=1))
            async with asyncio.timeout(PATIENCE):
                await line.ended.wait()
            assert line.why.startswith("the console did not answer")


async def test_a_line_goes_by_the_address_of_its_robot_in_a_fleet_and_opens_no_other_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("lockstep.server.sfu.coordinator.SfuCoordinator.arrived", lambda *_: True)
    heard = _Heard()
    async with running_fleet_rig("left", "right") as rig:
        token = rig.state.access.issue("observer", "ann")
        whep = Whep(parse_link(f"{rig.url}/robots/right/#token={token}"))
        line = _line(parse_link(f"{rig.url}/robots/left/#token={token}"), heard)
        async with whep, _open(line):
            await eventually(lambda: heard.has(Welcome))
            ticket = await whep.watch("0")
            with pytest.raises(InvalidStatus):
                async with connect(f"{rig.url.replace('http', 'ws', 1)}/robots/left/watch/{ticket}", proxy=None):
                    pass


async def test_a_line_is_encrypted_where_the_console_is_and_only_its_certificate_is_trusted(tmp_path: Path) -> None:
    certificate = self_signed(tmp_path, {"127.0.0.1"}, datetime.datetime.now(datetime.UTC))
    heard = _Heard()
    async with (
        running_bridge() as bridge,
        running_console(bridge.address[1], certificate=certificate, **RELAYED) as rig,
    ):
        await eventually(lambda: rig.dependencies.console.robot.description is not None)
        link = parse_link(f"{rig.url}/#token={rig.access.issue('observer', 'ann')}")
        line = WebSocketTransport(link, "0", certificate.chain, heard.take, PATIENCE)
        doubting = WebSocketTransport(link, "0", None, heard.take, PATIENCE)
        try:
            async with _open(line):
                await eventually(lambda: heard.has(Welcome))
                with pytest.raises(ConnectFailed):
                    await doubting.negotiate()
        finally:
            await doubting.close()


async def test_a_close_that_is_cancelled_closes_the_websocket() -> None:
    async with running_rig(**RELAYED) as rig:
        line = _line(parse_link(f"{rig.url}/#token={rig.access.issue('observer', 'ann')}"), _Heard())
        await line.negotiate()
        assert line._socket is not None
        line._socket.transport.pause_reading()  # the answer to the close is not heard
        closing = asyncio.create_task(line.close())
        await eventually(lambda: line._socket is not None and line._socket.state is State.CLOSING)
        closing.cancel()
        await asyncio.wait({closing})
        assert line._socket.transport.is_closing()
