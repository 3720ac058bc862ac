"""Which transport a connection gets."""

import asyncio

import pytest

from lockstep.client.console_url import parse_link
from lockstep.client.errors import SignallingRefused
from lockstep.client.transport.open_transport import open_transport
from lockstep.client.transport.webrtc_transport import WebRtcTransport
from lockstep.protocol.console import Welcome, decode_server_message
from tests.client.options import options
from tests.server.rig import PATIENCE, running_rig
from tests.server.watch_lines import NOWHERE


async def test_without_a_line_the_connection_has_data_channels_beside_the_relay(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def blocked(*_: object, **__: object) -> None:
        raise ConnectionRefusedError("a proxy")

    monkeypatch.setattr("lockstep.client.transport.websocket_transport.connect", blocked)
    async with running_rig(relay=NOWHERE, observers_direct=0) as rig:
        link = parse_link(f"{rig.url}/#token={rig.access.issue('observer', 'ann')}")
        welcomed = asyncio.Event()

        def take(data: str | bytes) -> None:
            if isinstance(decode_server_message(data), Welcome):
                welcomed.set()

        deadline = asyncio.get_running_loop().time() + PATIENCE
        transport, _ = await open_transport(options(link), take, deadline, beside="0")
        try:
            assert isinstance(transport, WebRtcTransport)
            await transport.connect(PATIENCE)
            async with asyncio.timeout(PATIENCE):
                await welcomed.wait()
            assert [peer.relay for peer in rig.dependencies.console.peers] == ["0"]
        finally:
            await transport.close()


async def test_while_the_console_does_not_reach_its_robot_it_is_asked_again_until_the_deadline(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = 0

    async def unreachable(_: WebRtcTransport) -> None:
        nonlocal asked
        asked += 1
        raise SignallingRefused(503, "robot_unreachable", "")

    monkeypatch.setattr(WebRtcTransport, "negotiate", unreachable)
    monkeypatch.setattr("lockstep.client.transport.open_transport.RETRY_SECONDS", 0.01)
    link = parse_link("http://127.0.0.1:9/#token=x")
    with pytest.raises(SignallingRefused):
        await open_transport(options(link), lambda _: None, asyncio.get_running_loop().time() + 0.1)
    assert asked > 1
