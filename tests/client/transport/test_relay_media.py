"""Where the headless client can watch."""

import asyncio

import msgspec
import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve

from lockstep.client.errors import ConnectFailed
from lockstep.client.transport import sfu_media
from lockstep.client.transport.sfu_media import RelayMedia, RelayTicket


async def _nothing(socket: ServerConnection) -> None:
    await socket.wait_closed()


async def test_a_relay_that_is_no_janus_is_refused_by_name() -> None:
    told = {"engine": "mediasoup", "relay": "0", "url": "wss://host", "feed": 7, "streams": []}
    ticket = msgspec.convert(told, RelayTicket)
    with pytest.raises(ConnectFailed, match="not through mediasoup"):
        RelayMedia(ticket, lambda _: None)


@pytest.mark.parametrize("late_from", [0.0, 60.0], ids=["a process that is always held up", "one that never is"])
async def test_a_relay_that_says_nothing_is_given_up_by(late_from: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sfu_media, "SILENCE_SECONDS", 0.02)
    monkeypatch.setattr(sfu_media, "HELD_UP_SECONDS", late_from)
    told = {"engine": "janus", "relay": "0", "url": "ws://host", "feed": 7, "room": 1, "streams": []}
    media = RelayMedia(msgspec.convert(told, RelayTicket), lambda _: None)
    try:
        async with asyncio.timeout(20):
            await media._watch()
        assert media.why == "no message came from the relay for 0.02 s"
    finally:
        await media.close()


async def test_a_close_that_is_cancelled_closes_the_websocket() -> None:
    async with serve(_nothing, "127.0.0.1", 0) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        told = {"engine": "janus", "relay": "0", "url": f"ws://127.0.0.1:{port}", "feed": 7, "room": 1, "streams": []}
        media = RelayMedia(msgspec.convert(told, RelayTicket), lambda _: None)
        media._socket = await connect(f"ws://127.0.0.1:{port}", proxy=None)
        media._socket.transport.pause_reading()  # the answer to the close is not heard
        closing = asyncio.create_task(media.close())
        await asyncio.sleep(0)
        closing.cancel()
        await asyncio.wait({closing})
        assert media._socket.transport.is_closing()
