"""A receiving peer for tests, and a plane to feed it. The signalling is a function call."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import replace
from typing import Any, cast

import numpy as np
from aiortc import RTCConfiguration, RTCPeerConnection, RTCRtpReceiver, RTCSessionDescription
from aiortc.codecs import CODECS, depayload
from aiortc.rtcrtpparameters import RTCRtpCodecParameters
from aiortc.rtp import RtpPacket, unpack_header_extensions
from prometheus_client import CollectorRegistry

from lockstep.protocol.description import Axis, Camera, Microphone, RobotDescription
from lockstep.protocol.messages import Media
from lockstep.rtc.endpoint import Connection, Endpoint
from lockstep.rtc.peer_events import Connected, MediaEvent, PeerEvent
from lockstep.rtc.sdp import parse_description, write_description
from lockstep.server.media.hub import MediaHub, MediaSettings, Subscriptions
from lockstep.server.media.pipeline.rtp_sender import RtpSender, SenderStats

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

    def __init__(self, pc: RTCPeerConnection, connection: Connection, media: Subscriptions, answer: str) -> None:
        self.pc = pc
        self.connection = connection  # the plane's end
        self.connected = asyncio.Event()  # it is
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

    def heard(self, event: PeerEvent) -> None:
        """An event of the plane's end, as a peer of the console hands it on."""
        if isinstance(event, Connected):
            self.media.connected()
            self.connected.set()
        elif isinstance(event, MediaEvent):
            self.media.heard(event.mid, event.event)

    def tell(self, compound: bytes) -> None:
        """Let the plane's end have an RTCP packet, as if it came decrypted from the peer."""
        self.connection.peer.media.streams.receive_rtcp(compound, asyncio.get_running_loop().time())
        self.connection.peer.media.stir()
        self.connection.flush()

    @property
    def ssrc(self) -> int:
        """Of the first stream."""
        return self.connection.peer.media.streams.outgoing[self.media.streams[0].mid].parameters.ssrc

    @property
    def stats(self) -> SenderStats:
        """Of the first stream."""
        return self.media.deliveries[0].target.sender.stats

    @property
    def dropped(self) -> int:
        """Frames that it did not get because it could not keep up."""
        return sum(delivery.target.dropped for delivery in self.media.deliveries)

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
async def running_plane(robot: RobotDescription | None = None, **settings: Any) -> AsyncIterator[MediaHub]:
    registry = CollectorRegistry()
    hub = MediaHub(MediaSettings(**settings), registry)
    cast(Any, hub).registry = registry  # for tests that read metrics
    hub.configure(robot or description())
    running = asyncio.create_task(hub.run())
    try:
        yield hub
    finally:
        running.cancel()
        with suppress(asyncio.CancelledError):
            await running


def with_extensions(offer: str, uris: dict[str, int]) -> str:
    """The offer with header extensions added to every media section."""
    lines = "".join(f"a=extmap:{identifier} {uri}\r\n" for uri, identifier in uris.items())
    return offer.replace("a=rtcp-mux\r\n", lines + "a=rtcp-mux\r\n")


@contextmanager
def high_profiles() -> Iterator[None]:
    """While entered, aiortc offers H.264 of Main and High too, as browsers do."""
    before = list(CODECS["video"])
    main = next(codec for codec in before if codec.name == "H264")
    for number, profile in ((120, "4d001f"), (122, "64001f")):
        parameters = {**main.parameters, "profile-level-id": profile}
        repair = RTCRtpCodecParameters("video/rtx", 90_000, None, number + 1, [], {"apt": number})
        CODECS["video"] += [replace(main, payloadType=number, parameters=parameters), repair]
    try:
        yield
    finally:
        CODECS["video"][:] = before


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
    hub: MediaHub,
    kinds: Sequence[str] = ("video", "audio"),
    *,
    codecs: Sequence[str] = ("H264", "opus"),
    uris: dict[str, int] | None = None,
    priority: bool = False,
    trailer: bool = False,
    thumbnail: bool = False,
    relays: bool = False,
) -> AsyncIterator[Viewer]:
    """A viewer whose media are flowing when this returns."""
    pc = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    try:
        for kind in kinds:
            pc.addTransceiver(kind, direction="recvonly")
        prefer(pc, codecs)
        await pc.setLocalDescription(await pc.createOffer())
        offer = parse_description(with_extensions(pc.localDescription.sdp, uris or {}))
        async with Endpoint(["127.0.0.1"]) as endpoint:
            turns = hub.datagrams.create(waits=not priority)
            connection = endpoint.connect(controlling=False, turns=turns)
            plan = hub.plan(offer, trailer=trailer, thumbnail=thumbnail)
            answer = write_description(connection.answer(offer, plan.media))
            if relays:  # with what it asks for, and treated as a relay
                media = hub.subscribers.publish(connection, plan)
            else:
                media = hub.subscribers.attach(connection, plan, priority=priority, turns=turns)
            viewer = Viewer(pc, connection, media, answer)
            connection.listen(viewer.heard)
            _notify_of_server_input(viewer)
            _record(viewer, {identifier: uri for uri, identifier in _answered(answer).items()})
            await pc.setRemoteDescription(RTCSessionDescription(answer, "answer"))
            await _connected(pc)
            async with asyncio.timeout(TIMEOUT):
                await viewer.connected.wait()
            yield viewer
            await media.close()
    finally:
        await pc.close()


def sender_of(viewer: Viewer) -> RtpSender:
    """What sends the viewer's first stream over RTP."""
    return viewer.media.deliveries[0].target.sender


def _notify_of_server_input(viewer: Viewer) -> None:
    """Wake `until` after everything the plane's end receives, too."""
    settle = viewer.connection.settle

    def settle_and_tell() -> None:
        settle()
        viewer.change_soon()

    cast(Any, viewer.connection).settle = settle_and_tell


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
