"""What a peer needs of its transport, said by one that is none: what it is told, and when."""

import asyncio
from typing import Any

from lockstep.protocol.messages import Pong, Stop
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import ChannelError, TransportRefused
from lockstep.server.peers.channels import ChannelName
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.transport import Transport, TransportEvents
from lockstep.server.settings import Settings
from tests.waiting import PATIENCE


class _Transport:
    """Notes what it is asked to send."""

    lost = 3

    def __init__(self, fault: Exception | None = None) -> None:
        self.sent: list[tuple[str, str]] = []
        self.closed = 0
        self.events: TransportEvents | None = None
        self._fault = fault

    def listen(self, events: TransportEvents) -> None:
        self.events = events

    def send(self, channel: ChannelName, text: str) -> None:
        self._send(channel, text)

    def send_newest(self, text: str) -> None:
        self._send("newest", text)

    def send_spare(self, text: str) -> None:
        self._send("spare", text)

    def _send(self, where: str, text: str) -> None:
        if self._fault is not None:
            raise self._fault
        self.sent.append((where, text))

    async def close(self) -> None:
        self.closed += 1


class _Media:
    """None at all."""

    streams: list[Any] = []
    voice = ""

    def __getattr__(self, name: str) -> Any:
        return lambda *_, **__: None

    async def close(self) -> None: ...


class _Host:
    def __init__(self) -> None:
        self.told: list[Any] = []

    def peer_joined(self, peer: Peer) -> None: ...

    def channel_opened(self, peer: Peer, channel: ChannelName) -> None:
        self.told.append(("opened", channel))

    def message_received(self, peer: Peer, channel: ChannelName, message: Any) -> None:
        self.told.append((channel, message))

    def input_refused(self, peer: Peer, channel: str, error: ChannelError) -> None:
        self.told.append((channel, error.name))

    def peer_ended(self, peer: Peer) -> None:
        self.told.append(("ended", peer.ended))

    def peer_failed(self, peer: Peer, stage: str, error: Exception) -> None:
        self.told.append((stage, error))


def _peer(transport: Transport) -> tuple[Peer, _Host]:
    limits: Any = Settings()
    host, media = _Host(), _Media()
    return Peer(transport, media, Identity("operator", "ann", "link", 0.0), host, limits), host


async def test_nothing_is_sent_before_a_channel_is_open_and_nothing_after_the_end() -> None:
    transport = _Transport()
    peer, _ = _peer(transport)
    peer.send_text("session", "too early")
    peer.send_feedback("too early")
    peer.channel_opened("session")
    peer.send_text("session", "welcome")
    peer.send_feedback("its channel is not open")
    peer.channel_opened("control")
    peer.send_feedback("feedback")
    peer.send_spare("extra")
    peer.end("closed")
    peer.send_text("session", "too late")
    peer.send_feedback("too late")
    assert transport.sent == [("session", "welcome"), ("newest", "feedback"), ("spare", "extra")]


async def test_a_transport_that_raises_ends_its_peer_alone_and_the_caller_sees_nothing() -> None:
    fault = ZeroDivisionError()
    peer, host = _peer(_Transport(fault))
    peer.channel_opened("control")
    peer.send("control", Pong(id=1))
    assert peer.ended == "internal error"
    assert ("message out", fault) in host.told


async def test_what_no_transport_can_hold_is_counted_and_ends_the_peer() -> None:
    peer, host = _peer(_Transport())
    peer.refused("transport", TransportRefused("too_large"))
    assert peer.ended == "too much"
    assert [name for name, _ in host.told] == ["transport", "ended"]


async def test_a_message_goes_to_the_channel_of_its_kind_where_one_connection_carries_all() -> None:
    peer, host = _peer(_Transport())
    peer.received(None, '{"type":"stop","by":"","reason":"smoke"}')
    assert host.told == [("stop", Stop(reason="smoke"))]


async def test_its_transport_is_closed_once_it_has_ended_and_who_waits_for_that_is_woken() -> None:
    transport = _Transport()
    peer, _ = _peer(transport)
    async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as tasks:
        tasks.create_task(peer.run())
        waiting = tasks.create_task(peer.liveness.until_ended())
        peer.liveness.connect()
        peer.end("link revoked")
        await waiting
    assert transport.closed == 1
    assert transport.lost == 3
