"""Two ends of a data channel, the one as the console tunes it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from aiortc import RTCConfiguration, RTCDataChannel, RTCPeerConnection, RTCSessionDescription
from aiortc.rtcsctptransport import DataChunk, SackChunk, parse_packet

from server.data_transport_private import tune_data_transport
from server.media.aiortc_private import create_peer_connection
from tests.server.rig import PATIENCE

__all__ = ["Ends", "acknowledgements_of", "connected", "lose", "packets_of"]


class Ends:
    """Two ends of a reliable channel: a plain client's and the server's."""

    def __init__(self, client: RTCDataChannel, server: RTCDataChannel) -> None:
        self.client = client
        self.server = server
        self.at_client: asyncio.Queue[str] = asyncio.Queue(100)
        self.at_server: asyncio.Queue[str] = asyncio.Queue(100)
        client.on("message", self.at_client.put_nowait)
        server.on("message", self.at_server.put_nowait)

    async def exchange(self) -> None:
        """One message each way, so that both have measured a round trip."""
        self.server.send("there")
        assert await self.at_client.get() == "there"
        self.client.send("back")
        assert await self.at_server.get() == "back"


@asynccontextmanager
async def connected(*, observes: bool = True) -> AsyncIterator[Ends]:
    """The server's side is tuned, the client's is plain aiortc. Sections are bundled, as browsers do."""
    client, server = RTCPeerConnection(RTCConfiguration(iceServers=[])), create_peer_connection()
    there: asyncio.Future[RTCDataChannel] = asyncio.get_running_loop().create_future()
    server.on("datachannel", there.set_result)
    opened = asyncio.Event()
    client.addTransceiver("video", direction="recvonly")
    here = client.createDataChannel("session")
    here.on("open", opened.set)
    try:
        async with asyncio.timeout(PATIENCE):
            await client.setLocalDescription(await client.createOffer())
            await server.setRemoteDescription(RTCSessionDescription(client.localDescription.sdp, "offer"))
            tune_data_transport(server, observes=observes)
            await server.setLocalDescription(await server.createAnswer())
            await client.setRemoteDescription(RTCSessionDescription(server.localDescription.sdp, "answer"))
            await opened.wait()
            yield Ends(here, await there)
    finally:
        await server.close()
        await client.close()


def lose(sctp: Any, first: int) -> list[bytes]:
    """Lose the first so many data packets that `sctp` sends; the list has what was lost."""
    lost: list[bytes] = []
    dtls = sctp.transport
    send = dtls._send_data

    async def send_or_lose(data: bytes) -> None:
        if len(lost) < first and any(isinstance(chunk, DataChunk) for chunk in parse_packet(data)[3]):
            lost.append(data)
        else:
            await send(data)

    dtls._send_data = send_or_lose
    return lost


def never_repeats(sctp: Any) -> None:
    """`sctp` sends nothing again: what its peer does not deliver or acknowledge by itself stays so."""
    sctp._t3_cancel()
    sctp._t3_expired = lambda: None


def packets_of(sctp: Any) -> list[bytes]:
    """The packets that `sctp` sends from now on."""
    left: list[bytes] = []
    dtls = sctp.transport
    send = dtls._send_data

    async def watch(data: bytes) -> None:
        left.append(data)
        await send(data)

    dtls._send_data = watch
    return left


def acknowledgements_of(sctp: Any) -> list[int]:
    """What `sctp` acknowledges from now on in packets of their own: the last number of each."""
    sent: list[int] = []
    send = sctp._send_chunk

    async def watch(chunk: Any) -> None:
        if isinstance(chunk, SackChunk):
            sent.append(chunk.cumulative_tsn)
        await send(chunk)

    sctp._send_chunk = watch
    return sent
