"""Connects two plain aiortc peers in this process through a forwarder."""

import asyncio

from aiortc import RTCPeerConnection, RTCSessionDescription

from lockstep.bench.harness.aioice_hosts import use_hosts
from lockstep.client.transport.webrtc_transport import Route

__all__ = ["connect_through"]

CONNECT_SECONDS = 20.0  # lost handshake packets are repeated after a second and more


async def connect_through(route: Route, asking: RTCPeerConnection, answering: RTCPeerConnection) -> None:
    """Exchange offer and answer, and wait until the peers are connected. `asking` has its data channel already."""
    connected = asyncio.Event()

    @asking.on("connectionstatechange")
    def changed() -> None:
        if asking.connectionState == "connected":
            connected.set()

    use_hosts(["127.0.0.1"])
    await asking.setLocalDescription(await asking.createOffer())
    offer = route.offer(asking.localDescription.sdp)
    await answering.setRemoteDescription(RTCSessionDescription(offer, "offer"))
    await answering.setLocalDescription(await answering.createAnswer())
    answer = route.answer(answering.localDescription.sdp)
    await asking.setRemoteDescription(RTCSessionDescription(answer, "answer"))
    async with asyncio.timeout(CONNECT_SECONDS):
        await connected.wait()
