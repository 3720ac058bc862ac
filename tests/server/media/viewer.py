"""A receiving peer for tests, and a plane to feed it. The signalling is a function call."""

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any, cast

import numpy as np
from aiortc import RTCConfiguration, RTCPeerConnection, RTCRtpReceiver, RTCSessionDescription
from aiortc.codecs import depayload
from aiortc.rtp import RtpPacket, unpack_header_extensions
from prometheus_client import CollectorRegistry

from robot_bridge.protocol.description import Axis, Camera, Microphone, RobotDescription
from robot_bridge.protocol.messages import Media
from server.media.aiortc_private import MediaSender, create_peer_connection
from server.media.plane import MediaPlane, MediaSettings, PeerMedia
from server.media.publishing_private import keep_answered_extensions

WIDTH, HEIGHT = 160, 120
TIMEOUT = 10.0


def description(cameras: int = 1, microphones: int = 1) -> RobotDescription:
    return RobotDescription(
        name="fake",
        label="Fake",
        axes=(Axis(name="x", label="X", unit="m/s", minimum=-1, maximum=1, slew=1, brake=1),),
        cameras=tuple(
            Camera(name=f"camera{i}", label=f"Camera {i}", width=WIDTH, height=HEIGHT, frame_rate=30.0)
            for i in range(cameras)
        ),
        microphones=tuple(
            Microphone(name=f"microphone{i}", label=f"Microphone {i}", sample_rate=16_000) for i in range(microphones)
        ),
    )


def picture(stamp: int, time: float, stream: str = "camera0", **changes: Any) -> Media:
    """A grey picture whose shade follows the stamp."""
    fields: dict[str, Any] = {
        "stream": stream,
        "codec": "yuv420p",
        "stamp": stamp,
        "time": time,
        "payload": bytes([stamp % 200 + 20]) * (WIDTH * HEIGHT) + b"\x80" * (WIDTH * HEIGHT // 2),
        "width": WIDTH,
        "height": HEIGHT,
    }
    return Media(**{**fields, **changes})


def noise(stamp: int, time: float, stream: str = "camera0") -> Media:
    """A picture that needs many packets."""
    luma = np.random.default_rng(stamp).integers(0, 255, WIDTH * HEIGHT, np.uint8).tobytes()
    return picture(stamp, time, stream, payload=luma + b"\x80" * (WIDTH * HEIGHT // 2))


def sound(stamp: int, time: float, stream: str = "microphone0", rate: int = 16_000, **changes: Any) -> Media:
    """20 ms of a tone."""
    phase = np.arange(rate // 50) * 440 * 2 * np.pi / rate
    payload = (np.sin(phase) * 8000).astype("<i2").tobytes()
    fields: dict[str, Any] = {
        "stream": stream,
        "codec": "pcm_s16le",
        "stamp": stamp,
        "time": time,
        "payload": payload,
        "sample_rate": rate,
        "channels": 1,
    }
    return Media(**{**fields, **changes})


class Received:
    """One RTP packet, as it came out of SRTP."""

    def __init__(self, data: bytes, uris: dict[int, str]) -> None:
        self.packet = RtpPacket.parse(data)
        self.extensions: dict[str, bytes] = {}
        if data[0] & 0x10:
            profile, words = int.from_bytes(data[12:14], "big"), int.from_bytes(data[14:16], "big")
            for identifier, value in unpack_header_extensions(profile, data[16 : 16 + 4 * words]):
                self.extensions[uris.get(identifier, f"id {identifier}")] = value


class Viewer:
    """Receives; keeps every packet."""

    def __init__(self, pc: RTCPeerConnection, server: RTCPeerConnection, media: PeerMedia, answer: str) -> None:
        self.pc = pc
        self.server = server
        self.media = media
        self.answer = answer
        self.received: list[Received] = []
        self.lose: Callable[[Received], bool] = lambda received: False
        self._changed = asyncio.Condition()
        self._changing: set[asyncio.Task[None]] = set()

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition` holds; it is checked after everything either side receives."""
        async with asyncio.timeout(TIMEOUT), self._changed:
            await self._changed.wait_for(condition)

    async def changed(self) -> None:
        async with self._changed:
            self._changed.notify_all()

    def change_soon(self) -> None:
        """As `changed`, for callers that cannot wait."""
        task = asyncio.get_running_loop().create_task(self.changed())
        self._changing.add(task)
        task.add_done_callback(self._changing.discard)

    def of(self, kind: str) -> list[Received]:
        """Packets of the first section of a kind, without retransmissions."""
        transceiver = next(t for t in self.pc.getTransceivers() if t.kind == kind)
        payload_type = cast(Any, transceiver)._codecs[0].payloadType
        return [received for received in self.received if received.packet.payload_type == payload_type]

    def frames(self, kind: str) -> list[bytes]:
        """Assembled encoded frames, whole ones only when nothing is lost."""
        transceiver = next(t for t in self.pc.getTransceivers() if t.kind == kind)
        codec = cast(Any, transceiver)._codecs[0]
        frames: dict[int, bytes] = {}
        for received in self.of(kind):
            data = depayload(codec, received.packet.payload)
            frames[received.packet.timestamp] = frames.get(received.packet.timestamp, b"") + data
        return list(frames.values())


@asynccontextmanager
async def running_plane(robot: RobotDescription | None = None, **settings: Any) -> AsyncIterator[MediaPlane]:
    registry = CollectorRegistry()
    plane = MediaPlane(MediaSettings(**settings), registry)
    cast(Any, plane).registry = registry  # for tests that read metrics
    plane.configure(robot or description())
    try:
        yield plane
    finally:
        await plane.close()


def with_extensions(offer: str, uris: dict[str, int]) -> str:
    """The offer with header extensions added to every media section."""
    lines = "".join(f"a=extmap:{identifier} {uri}\r\n" for uri, identifier in uris.items())
    return offer.replace("a=rtcp-mux\r\n", lines + "a=rtcp-mux\r\n")


def prefer(pc: RTCPeerConnection, codecs: Sequence[str]) -> None:
    for transceiver in pc.getTransceivers():
        capabilities = RTCRtpReceiver.getCapabilities(transceiver.kind)
        assert capabilities is not None
        known = {name.lower() for name in codecs} | {"rtx"}
        wanted = [c for c in capabilities.codecs if c.mimeType.split("/")[1].lower() in known]
        order = [name.lower() for name in codecs]
        wanted.sort(key=lambda c: [*order, "rtx"].index(c.mimeType.split("/")[1].lower()))
        if any(not c.mimeType.endswith("rtx") for c in wanted):
            transceiver.setCodecPreferences(wanted)


@asynccontextmanager
async def viewing(
    plane: MediaPlane,
    kinds: Sequence[str] = ("video", "audio"),
    *,
    codecs: Sequence[str] = ("H264", "opus"),
    uris: dict[str, int] | None = None,
    priority: bool = False,
    trailer: bool = False,
    thumbnail: bool = False,
) -> AsyncIterator[Viewer]:
    """A viewer whose media are flowing when this returns."""
    pc, server = RTCPeerConnection(RTCConfiguration(iceServers=[])), create_peer_connection()
    try:
        for kind in kinds:
            pc.addTransceiver(kind, direction="recvonly")
        prefer(pc, codecs)
        await pc.setLocalDescription(await pc.createOffer())
        offer = with_extensions(pc.localDescription.sdp, uris or {})
        await server.setRemoteDescription(RTCSessionDescription(offer, "offer"))
        media = plane.attach(server, offer, priority=priority, waits=not priority, trailer=trailer, thumbnail=thumbnail)
        await server.setLocalDescription(await server.createAnswer())
        answer = server.localDescription.sdp
        viewer = Viewer(pc, server, media, answer)
        _record(viewer, {identifier: uri for uri, identifier in _answered(answer).items()})
        _notify_of_server_input(viewer)
        await pc.setRemoteDescription(RTCSessionDescription(answer, "answer"))
        await _connected(pc)
        await _connected(server)
        yield viewer
    finally:
        await server.close()
        await pc.close()


@asynccontextmanager
async def relaying(plane: MediaPlane, camera_codec: str = "H264") -> AsyncIterator[Viewer]:
    """A relay that the plane publishes to, and whose media are flowing when this returns: the console offers."""
    pc, server = RTCPeerConnection(RTCConfiguration(iceServers=[])), create_peer_connection()
    try:
        media = plane.publish(server, camera_codec)
        await server.setLocalDescription(await server.createOffer())
        await pc.setRemoteDescription(server.localDescription)
        await pc.setLocalDescription(await pc.createAnswer())
        answer = pc.localDescription.sdp
        viewer = Viewer(pc, server, media, answer)
        await server.setRemoteDescription(RTCSessionDescription(answer, "answer"))
        keep_answered_extensions(server, answer)
        _record(viewer, {identifier: uri for uri, identifier in _answered(answer).items()})
        _notify_of_server_input(viewer)
        await _connected(pc)
        await _connected(server)
        yield viewer
    finally:
        await server.close()
        await pc.close()


def sender_of(viewer: Viewer) -> MediaSender:
    """What sends the viewer's first stream over RTP."""
    sender = viewer.media._deliveries[0].sender
    assert isinstance(sender, MediaSender)
    return sender


def _notify_of_server_input(viewer: Viewer) -> None:
    """Wake `until` after everything the server receives, too."""
    for transport in {cast(Any, t.receiver.transport) for t in viewer.server.getTransceivers()}:
        receive, intake = transport._recv_next, transport.transport._connection._queue
        handled = intake._handled  # most datagrams do not come to `_recv_next`

        async def received(receive: Any = receive) -> None:
            await receive()
            await viewer.changed()

        def handled_and_told(data: bytes, handled: Any = handled) -> bool:
            viewer.change_soon()
            return bool(handled(data))

        transport._recv_next = received
        intake._handled = handled_and_told


def _answered(answer: str) -> dict[str, int]:
    fields = [line[9:].split() for line in answer.splitlines() if line.startswith("a=extmap:")]
    return {uri: int(identifier) for identifier, uri in fields}


def _record(viewer: Viewer, uris: dict[int, str]) -> None:
    for transceiver in viewer.pc.getTransceivers():
        dtls = cast(Any, transceiver.receiver.transport)
        if hasattr(dtls, "recorded"):
            continue
        dtls.recorded = True
        handle = dtls._handle_rtp_data

        async def record(data: bytes, arrival_time_ms: int, handle: Any = handle) -> None:
            received = Received(data, uris)
            if not viewer.lose(received):
                viewer.received.append(received)
                await handle(data, arrival_time_ms=arrival_time_ms)
            await viewer.changed()

        dtls._handle_rtp_data = record


async def _connected(pc: RTCPeerConnection) -> None:
    event = asyncio.Event()

    def check() -> None:
        if pc.connectionState == "connected":
            event.set()

    pc.on("connectionstatechange", check)
    check()
    async with asyncio.timeout(TIMEOUT):
        await event.wait()
