"""The session as one publisher in a Janus: encoded media with trailers, and feedback on a data channel."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Protocol

from aiortc import RTCBundlePolicy, RTCConfiguration, RTCPeerConnection, RTCSessionDescription

from robot_bridge.protocol.console import StreamInfo
from robot_bridge.protocol.janus import Heard, complete_description
from server.channel_writer import ChannelWriter
from server.data_transport_private import tune_data_transport
from server.ice_restart_private import keep_path
from server.media.peer_media import PeerMedia
from server.media.publishing_private import ask_for_no_delay, keep_answered_extensions
from server.relay.errors import RelayRefused, RelaySilent
from server.relay.janus_room import JanusRoom
from server.relay.janus_session import JanusSession
from server.relay.publication import Publication

__all__ = ["PublishedMedia", "publish"]

CONNECT_SECONDS = 15.0
CLOSE_SECONDS = 2.0
FEEDBACK = "feedback"  # label of the data channel


class PublishedMedia(Protocol):
    """What it needs of the media plane."""

    def publish(self, pc: RTCPeerConnection, camera_codec: str = "") -> PeerMedia: ...


@asynccontextmanager
async def publish(
    session: JanusSession,
    room_of: Callable[[JanusSession], JanusRoom],
    media: PublishedMedia,
    feed: int,
    codec: str = "",
) -> AsyncIterator[Publication]:
    """Published while entered; the yielded object says when it ended by itself. Raises RelayError on entering."""
    room = room_of(session)
    found: list[Publication] = []

    def heard(event: Heard) -> None:
        if event.kind == "ended" and found:
            found[0].end(event.detail)

    handle = await session.attach(heard)
    await room.prepare(handle)
    # One transport from the start: Janus bundles everything.
    pc = RTCPeerConnection(RTCConfiguration(iceServers=[], bundlePolicy=RTCBundlePolicy.MAX_BUNDLE))
    given: PeerMedia | None = None
    try:
        given = media.publish(pc, codec)
        writer = ChannelWriter(pc.createDataChannel(FEEDBACK, ordered=False, maxRetransmits=0))
        tune_data_transport(pc)
        keep_path(pc)
        offer = await pc.createOffer()
        await pc.setLocalDescription(RTCSessionDescription(ask_for_no_delay(offer.sdp), "offer"))
        mids = [transceiver.mid or "" for transceiver in pc.getTransceivers()]
        streams = [_with_mid(stream, mid) for stream, mid in zip(given.streams, mids, strict=True)]
        names = {stream.mid: stream.stream for stream in streams}
        answer = complete_description(await room.publish(handle, feed, pc.localDescription.sdp, names))
        publication = Publication(feed, streams, writer.send_newest)
        given.on_failed(publication.failed)
        found.append(publication)
        await _connect(pc, answer, publication)
        yield publication
    finally:
        try:
            async with asyncio.timeout(CLOSE_SECONDS):
                if given is not None:
                    await given.close()
                await pc.close()
        except TimeoutError:
            pass  # what is left ends with the process


async def _connect(pc: RTCPeerConnection, answer: str, publication: Publication) -> None:
    connected = asyncio.Event()

    def changed() -> None:
        if pc.connectionState in ("failed", "closed"):
            publication.end(f"connection {pc.connectionState}")
            connected.set()
        elif pc.connectionState == "connected":
            connected.set()

    pc.on("connectionstatechange", changed)
    try:
        await pc.setRemoteDescription(RTCSessionDescription(answer, "answer"))
    except Exception as error:
        # aiortc has no error of its own for an answer that it cannot use.
        raise RelayRefused("its answer cannot be used") from error
    keep_answered_extensions(pc, answer)
    try:
        async with asyncio.timeout(CONNECT_SECONDS):
            await connected.wait()
    except TimeoutError as error:
        raise RelaySilent("no path for media") from error
    if publication.ended.is_set():
        raise RelaySilent(publication.why)


def _with_mid(stream: StreamInfo, mid: str) -> StreamInfo:
    return StreamInfo(
        mid=mid,
        stream=stream.stream,
        label=stream.label,
        kind=stream.kind,
        codec=stream.codec,
        carrier=stream.carrier,
    )
