"""What a connection receives reaches whoever takes it, on two endpoints on loopback."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from lockstep.client.media.frame_assembler import MediaPacket
from lockstep.client.transport.media_sections import receiving
from lockstep.client.transport.packets import Packets
from lockstep.client.transport.sdp import read_sections
from lockstep.protocol.carriers import EVENT_REFERENCE_URI, pack_event_reference
from lockstep.rtc.endpoint import Connection, Endpoint
from lockstep.rtc.peer import OfferedMedia
from lockstep.rtc.peer_events import Connected, MediaEvent, PeerEvent
from lockstep.rtc.rtp.stage import KeyframeRequested
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.sdp import LocalMedia, write_description

HOST = "127.0.0.1"
SECONDS = 20


class Sink:
    def __init__(self) -> None:
        self.packets: list[MediaPacket] = []
        self.came = asyncio.Event()

    def packet(self, payload_type: int, packet: MediaPacket) -> bool:
        self.packets.append(packet)
        self.came.set()
        return True


class Watching:
    """`receiver` gets a camera from `sender`."""

    def __init__(self, receiver: Connection, sender: Connection) -> None:
        self.receiver, self.sender = receiver, sender
        self.packets = Packets(receiver, "native")
        self.text = ""

    def connect(self) -> None:
        media = receiving("video", extension=EVENT_REFERENCE_URI)
        camera = LocalMedia(media.codecs, "sendonly", media.extensions)
        answer = self.sender.answer(self.receiver.offer([OfferedMedia("0", "video", media)]), {"0": camera})
        self.text = write_description(answer)
        self.answer = answer

    async def sent(self, payload: bytes, stamp: bytes = b"") -> None:
        values = {EVENT_REFERENCE_URI: stamp} if stamp else {}
        self.sender.send_frame("0", [payload], 3000, values=values)


@asynccontextmanager
async def watching() -> AsyncIterator[Watching]:
    async with Endpoint([HOST]) as ours, Endpoint([HOST]) as theirs:
        found: list[Watching] = []
        receiver = ours.connect(controlling=True, listener=lambda event: found[0].packets.heard(event))
        found.append(Watching(receiver, theirs.connect(controlling=False)))
        found[0].connect()
        yield found[0]
        receiver.close()


async def until(connection: Connection, kind: type) -> PeerEvent:
    async with asyncio.timeout(SECONDS):
        async for event in connection:
            if isinstance(event, kind):
                return event
    raise AssertionError("ended")


async def test_a_packet_reaches_its_sink_with_its_stamp_and_a_keyframe_is_asked_for() -> None:
    async with watching() as pair, asyncio.timeout(SECONDS):
        sink = Sink()
        sections = read_sections(pair.text)
        pair.packets.to_sinks({"0": sink}, sections)
        pair.receiver.accept(pair.answer)
        await until(pair.sender, Connected)
        await pair.sent(b"\x10picture", pack_event_reference(77))
        await sink.came.wait()
        [packet] = sink.packets
        assert (packet.data, packet.stamp, packet.marker) == (b"picture", 77, True)
        event = await until(pair.sender, MediaEvent)
        assert isinstance(event, MediaEvent)
        assert isinstance(event.event, KeyframeRequested)


async def test_what_nobody_takes_or_understands_is_counted() -> None:
    async with watching() as pair, asyncio.timeout(SECONDS):
        sink = Sink()
        pair.packets.to_sinks({"0": sink}, read_sections(pair.text))
        pair.receiver.accept(pair.answer)
        await until(pair.sender, Connected)
        await pair.sent(b"\x10")  # a descriptor and nothing behind it
        await pair.sent(b"\x10picture", b"12")
        await sink.came.wait()
        assert [packet.stamp for packet in sink.packets] == [None]
        assert pair.packets.counts == {"payload": 1}


async def test_plain_packets_are_handed_on_and_reports_of_our_own_arrive() -> None:
    async with watching() as pair, asyncio.timeout(SECONDS):
        taken: list[bytes] = []
        came = asyncio.Event()

        def take(data: bytes) -> None:
            taken.append(data)
            came.set()

        pair.packets.plain(take, lambda data: None)
        pair.packets.send_control(b"")
        assert pair.packets.counts == {"control_not_sent": 1}
        pair.receiver.accept(pair.answer)
        await until(pair.sender, Connected)
        await pair.sent(b"\x10picture")
        await came.wait()
        assert RtpPacket.parse(taken[0]).payload == b"\x10picture"


async def test_without_a_connection_there_is_nothing_to_take_from() -> None:
    async with Endpoint([HOST]) as endpoint:
        packets = Packets(endpoint.connect(controlling=True), "trailer")
        packets.send_control(b"")
        assert packets.counts["control_not_sent"] == 1
        with pytest.raises(RuntimeError):
            endpoint.connect(controlling=True).peer.negotiation.tagged  # noqa: B018
