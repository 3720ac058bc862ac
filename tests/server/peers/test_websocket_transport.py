"""Watchers on lines that are not sockets: faults, goodbyes that do not end, turns."""

import asyncio
from typing import Any

import pytest

from lockstep.protocol.console import ClientMessage
from lockstep.protocol.messages import Ping, Pong
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import ChannelError
from lockstep.server.peers.channels import ChannelName
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.websocket_transport import LineEnded, WebSocketTransport, close_code, peer_beside_relay
from lockstep.server.settings import Settings
from lockstep.server.util.fair_queue import FairQueue
from tests.server.rig import PATIENCE


class _Host:
    def __init__(self) -> None:
        self.heard: list[tuple[ChannelName, ClientMessage]] = []
        self.opened: list[ChannelName] = []
        self.ended: list[Peer] = []
        self.faults: list[tuple[str, Exception]] = []

    def peer_joined(self, peer: Peer) -> None: ...

    def channel_opened(self, peer: Peer, channel: ChannelName) -> None:
        self.opened.append(channel)

    def message_received(self, peer: Peer, channel: ChannelName, message: ClientMessage) -> None:
        self.heard.append((channel, message))

    def input_refused(self, peer: Peer, channel: str, error: ChannelError) -> None:
        raise AssertionError(error.name)

    def peer_ended(self, peer: Peer) -> None:
        self.ended.append(peer)

    def peer_failed(self, peer: Peer, stage: str, error: Exception) -> None:
        self.faults.append((stage, error))


class _Line:
    """`texts` come in, then nothing more, or a fault."""

    def __init__(self, *texts: str, fault: Exception | None = None, closes: bool = True) -> None:
        self.sent: list[str] = []
        self.closed: tuple[int, str] | None = None
        self._texts = list(texts)
        self._fault = fault
        self._closes = closes

    async def receive(self) -> str:
        if self._texts:
            return self._texts.pop(0)
        if self._fault is not None:
            raise self._fault
        await asyncio.Event().wait()
        raise AssertionError

    async def send(self, text: str) -> None:
        self.sent.append(text)

    async def close(self, code: int, reason: str) -> None:
        self.closed = code, reason
        if not self._closes:
            await asyncio.Event().wait()


def _watcher(host: _Host, turns: FairQueue | None = None) -> tuple[Peer, WebSocketTransport]:
    identity = Identity("observer", "ann", "link", 0.0)
    limits: Any = Settings()
    return peer_beside_relay("0", identity, host, limits, turns or FairQueue())


async def test_every_channel_opens_and_messages_go_where_their_kind_belongs() -> None:
    host = _Host()
    line = _Line(
        '{"type":"ping","id":1}', '{"type":"note","text":"n"}', '{"type":"stop","by":""}', fault=LineEnded(1000)
    )
    watcher, transport = _watcher(host)
    await transport.serve(line)
    assert host.opened == ["control", "session", "stop"]
    assert [channel for channel, _ in host.heard] == ["control", "session", "stop"]
    assert host.heard[0][1] == Ping(id=1)
    assert (watcher.ended, host.ended, line.closed) == ("line closed", [watcher], (1000, "line closed"))


async def test_a_fault_ends_the_watcher_by_name_and_nothing_comes_out() -> None:
    host, fault = _Host(), ZeroDivisionError()
    watcher, transport = _watcher(host)
    line = _Line(fault=fault)
    await transport.serve(line)
    assert watcher.ended == "internal error"
    assert line.closed == (1011, "internal error")
    assert host.faults == [("line", fault)]


async def test_a_goodbye_that_does_not_end_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lockstep.server.peers.websocket_transport.GOODBYE_SECONDS", 0.01)
    async with asyncio.timeout(PATIENCE):
        _, transport = _watcher(_Host())
        await transport.serve(_Line(fault=LineEnded(1000), closes=False))


async def test_what_everyone_is_told_goes_to_one_watcher_in_each_turn_of_the_loop() -> None:
    turns = FairQueue()
    watchers = [_watcher(_Host(), turns) for _ in range(20)]
    lines = [_Line() for _ in watchers]
    async with asyncio.TaskGroup() as tasks:
        for (_, transport), line in zip(watchers, lines, strict=True):
            tasks.create_task(transport.serve(line))
        await asyncio.sleep(0)
        for watcher, _ in watchers:
            watcher.send("session", Pong(id=1))
        counts = [0]
        async with asyncio.timeout(PATIENCE):
            while counts[-1] < len(lines):
                await asyncio.sleep(0)
                counts.append(sum(len(line.sent) for line in lines))
        for watcher, _ in watchers:
            watcher.end("shutdown")
    assert max(after - before for before, after in zip(counts, counts[1:], strict=False)) <= 2
    assert {line.closed for line in lines} == {(1001, "shutdown")}


def test_ends_that_are_somebodys_fault_have_a_code_of_their_own() -> None:
    assert close_code("link revoked") == close_code("does not read") == 1008
    assert close_code("new epoch") == 1012
    assert close_code("anything else") == 1000
