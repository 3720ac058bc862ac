"""Whole endpoints on loopback: ours with ours, and with aiortc as it is."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AsyncExitStack
from fractions import Fraction

import pytest
from aiortc import RTCDataChannel, RTCPeerConnection, RTCSessionDescription, VideoStreamTrack
from av import VideoFrame
from av.frame import Frame

from lockstep.rtc.addresses import Path
from lockstep.rtc.channels import ChannelClosed, ChannelMessage, ChannelOpened
from lockstep.rtc.endpoint import Connection, Endpoint, EndpointSettings, TooManyPeers
from lockstep.rtc.peer import OfferedMedia
from lockstep.rtc.peer_events import Answered, Connected, PacketReceived, PeerEnded, PeerEvent, PlainRtp
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.sdp import MID_URI, Codec, LocalMedia, parse_description, write_description
from tests.rtc.vp8 import packetise

VP8 = Codec(96, "VP8", 90_000, feedback=("nack", "nack pli", "goog-remb"))
RTX = Codec(97, "rtx", 90_000, parameters={"apt": "96"})
HOST = "127.0.0.1"


@pytest.fixture
async def endpoint() -> AsyncIterator[Endpoint]:
    async with Endpoint([HOST]) as found:
        yield found


async def until(connection: Connection, wanted: Callable[[PeerEvent], bool]) -> PeerEvent:
    async for event in connection:
        if wanted(event):
            return event
        assert not isinstance(event, PeerEnded), event
    raise AssertionError("ended")


def of(kind: type) -> Callable[[PeerEvent], bool]:
    return lambda event: isinstance(event, kind)


async def test_many_peers_share_one_port(endpoint: Endpoint) -> None:
    async with AsyncExitStack() as stack:
        pairs = []
        for _ in range(5):
            other = await stack.enter_async_context(Endpoint([HOST]))
            offerer, answerer = endpoint.connect(controlling=True), other.connect(controlling=False)
            offerer.accept(answerer.answer(offerer.offer(), {}))
            pairs.append((offerer, answerer))
        for number, (offerer, answerer) in enumerate(pairs):
            await until(offerer, of(Connected))
            channel = offerer.open_channel("x")
            offerer.send(channel, f"message {number}")
            message = await until(answerer, of(ChannelMessage))
            assert message == ChannelMessage(channel, f"message {number}")
        assert len({each.peer.ice.path.local for each, _ in pairs if each.peer.ice.path}) == 1
        for offerer, answerer in pairs:
            offerer.close()
            assert await until_ended(offerer) == PeerEnded("closed")
            assert await until_ended(answerer) == PeerEnded("peer_closed")


async def until_ended(connection: Connection) -> PeerEvent:
    return [event async for event in connection][-1]


async def test_the_number_of_peers_is_bounded() -> None:
    async with Endpoint([HOST], settings=EndpointSettings(peers=1)) as endpoint:
        connection = endpoint.connect(controlling=True)
        with pytest.raises(TooManyPeers):
            endpoint.connect(controlling=True)
        connection.close()
        assert await until_ended(connection) == PeerEnded("closed")
        endpoint.connect(controlling=True)


async def test_what_an_application_does_not_read_is_bounded() -> None:
    few = EndpointSettings(waiting_packets=10, waiting_events=40)
    sound = LocalMedia((Codec(111, "opus", 48_000, 2),), extensions=(MID_URI,))
    async with Endpoint([HOST]) as ours, Endpoint([HOST], settings=few) as theirs:
        sender, lazy = ours.connect(controlling=True), theirs.connect(controlling=False)
        lazy.urgent = True
        answer = lazy.answer(sender.offer([OfferedMedia("sound", "audio", sound)]), {"sound": sound})
        sender.accept(answer)
        sender.add_candidate("candidate:1 1 udp 1 127.0.0.1 9 typ host")
        await until(sender, of(Connected))
        for number in range(50):
            sender.send_frame("sound", [b"x"], number * 960, marker=False)
        channel = sender.open_channel("x")
        await until(sender, of(ChannelOpened))
        assert lazy.counts["packet_not_read"] >= 40
        for number in range(100):
            sender.send(channel, str(number))
        assert await until_ended(sender) == PeerEnded("peer_closed")
        read = [event async for event in lazy]
        assert read[-1] == PeerEnded("closed")
        assert len(read) == 41
        assert lazy.counts["event_not_read"] > 0


async def test_a_channel_closes_at_both_ends(endpoint: Endpoint) -> None:
    async with Endpoint([HOST]) as other:
        offerer, answerer = endpoint.connect(controlling=True), other.connect(controlling=False)
        offerer.accept(answerer.answer(offerer.offer(), {}))
        await until(offerer, of(Connected))
        channel = offerer.open_channel("x")
        await until(answerer, of(ChannelOpened))
        offerer.close_channel(channel)
        assert await until(answerer, of(ChannelClosed)) == ChannelClosed(channel)
        assert await until(offerer, of(ChannelClosed)) == ChannelClosed(channel)


async def test_a_port_that_is_taken_is_an_error_and_leaves_nothing_open(endpoint: Endpoint) -> None:
    [address] = endpoint.sockets.by_address
    with pytest.raises(OSError, match="in use"):
        Endpoint(["127.0.0.2", HOST], address[1])
    async with Endpoint(["127.0.0.2"], address[1]):
        pass


class Strip(VideoStreamTrack):
    """Pictures of one grey each, brighter from one to the next."""

    def __init__(self) -> None:
        super().__init__()
        self._number = 0

    async def recv(self) -> VideoFrame:
        pts, time_base = await self.next_timestamp()
        frame = VideoFrame(64, 64, "yuv420p")
        for plane in frame.planes:
            plane.update(bytes([self._number * 16 % 256]) * plane.buffer_size)
        self._number += 1
        frame.pts, frame.time_base = pts, time_base
        return frame


async def test_aiortc_answers_and_gets_messages_and_pictures_with_header_extensions(endpoint: Endpoint) -> None:
    pc = RTCPeerConnection()
    frames: asyncio.Queue[Frame] = asyncio.Queue()
    received: asyncio.Queue[str] = asyncio.Queue()
    tasks = []

    @pc.on("track")
    def on_track(track: VideoStreamTrack) -> None:
        async def read() -> None:
            while True:
                frames.put_nowait(await track.recv())

        tasks.append(asyncio.create_task(read()))

    @pc.on("datachannel")
    def on_channel(channel: RTCDataChannel) -> None:
        channel.on("message", received.put_nowait)
        channel.send("from aiortc")

    connection = endpoint.connect(controlling=True)
    camera = LocalMedia((VP8, RTX), "sendonly", (MID_URI,), msid="camera track")
    try:
        offer = connection.offer([OfferedMedia("camera", "video", camera)])
        await pc.setRemoteDescription(RTCSessionDescription(write_description(offer), "offer"))
        await pc.setLocalDescription(await pc.createAnswer())
        connection.accept(parse_description(pc.localDescription.sdp))
        await until(connection, of(Connected))
        channel = connection.open_channel("x")
        connection.send(channel, "from us")
        assert await received.get() == "from us"
        assert await until(connection, of(ChannelMessage)) == ChannelMessage(channel, "from aiortc")
        for number, payloads in enumerate(packetise(10)):
            connection.send_frame("camera", payloads, number * 3000)
        frame = await frames.get()
        assert isinstance(frame, VideoFrame)
        assert (frame.width, frame.height) == (64, 64)
        assert frame.time_base == Fraction(1, 90_000)
    finally:
        for task in tasks:
            task.cancel()
        connection.close()
        await pc.close()


async def test_aiortc_offers_and_sends_pictures_and_messages(endpoint: Endpoint) -> None:
    pc = RTCPeerConnection()
    pc.addTrack(Strip())
    theirs = pc.createDataChannel("theirs")
    received: asyncio.Queue[str] = asyncio.Queue()
    theirs.on("open", lambda: theirs.send("from aiortc"))
    theirs.on("message", received.put_nowait)
    connection = endpoint.connect(controlling=False)
    try:
        await pc.setLocalDescription(await pc.createOffer())
        offer = parse_description(pc.localDescription.sdp)
        video = next(section for section in offer.sections if section.kind == "video")
        screen = LocalMedia((VP8, RTX), "recvonly", (MID_URI,))
        answer = connection.answer(offer, {video.mid: screen})
        await pc.setRemoteDescription(RTCSessionDescription(write_description(answer), "answer"))
        opened = packet = message = None
        while opened is None or packet is None or message is None:
            event = await anext(connection)
            assert not isinstance(event, PeerEnded), event
            opened = event if isinstance(event, ChannelOpened) else opened
            packet = event if isinstance(event, PacketReceived) else packet
            message = event if isinstance(event, ChannelMessage) else message
        assert opened.label == "theirs"
        assert message.data == "from aiortc"
        assert packet.mid == video.mid
        assert packet.packet.values[MID_URI] == video.mid.encode()
        connection.send(opened.channel, "from us")
        assert await received.get() == "from us"
        await pc.close()
        assert await until_ended(connection) == PeerEnded("peer_closed")
    finally:
        connection.close()
        await pc.close()


async def test_a_listener_hears_everything_in_order_and_its_faults_are_its_own(endpoint: Endpoint) -> None:
    heard: list[PeerEvent] = []
    done = asyncio.Event()
    faults: list[str] = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _, context: faults.append(context["message"]))

    def listen(event: PeerEvent) -> None:
        heard.append(event)
        if isinstance(event, Connected):
            offerer.send(offerer.open_channel("x"), "from within")
            raise RuntimeError("for the test")
        if isinstance(event, ChannelOpened):
            done.set()

    async with Endpoint([HOST]) as other:
        offerer = endpoint.connect(controlling=True, listener=listen)
        answerer = other.connect(controlling=False)
        offerer.accept(answerer.answer(offerer.offer(), {}))
        assert await until(answerer, of(ChannelMessage)) == ChannelMessage(0, "from within")
        async with asyncio.timeout(20):
            await done.wait()
        offerer.close()
    assert faults == ["a listener failed"]
    assert heard[-1] == PeerEnded("closed")


async def test_an_urgent_message_is_heard_before_the_next_datagram_is_read_and_none_of_a_datagram_is_missed() -> None:
    heard: list[str | bytes] = []

    def listen(event: PeerEvent) -> None:
        if isinstance(event, ChannelMessage):
            heard.append(event.data)

    async with Endpoint([HOST]) as here, Endpoint([HOST]) as there:
        sender, driver = here.connect(controlling=True), there.connect(controlling=False)
        sender.accept(driver.answer(sender.offer(), {}))
        await until(sender, of(Connected))
        channel = sender.open_channel("x")
        sender.send(channel, "first")
        await until(driver, of(ChannelMessage))
        driver.listen(listen)
        driver.urgent = True
        path = driver.peer.ice.path
        assert path is not None

        def datagram(text: str) -> bytes:
            now = asyncio.get_running_loop().time()
            sender.peer.need_channels(now).send(channel, text, now)
            [found] = sender.peer.datagrams_to_send()
            return found.data

        def arriving() -> Iterator[tuple[bytes, Path]]:
            yield datagram("a"), path
            assert heard == ["a"]
            yield datagram("b") + datagram("c"), path
            assert heard == ["a", "b", "c"]

        there._receive(arriving())
        assert heard == ["a", "b", "c"]
        sender.close()


async def test_addresses_that_come_later_are_used_and_those_that_are_none_left_out(endpoint: Endpoint) -> None:
    endpoint.use_hosts(["127.0.0.2", "192.0.2.200", HOST])
    assert [each.base[0] for each in endpoint.candidates] == ["127.0.0.2", HOST]
    assert len({each.base[1] for each in endpoint.candidates}) == 1
    assert endpoint.counts["host_not_bound"] == 1
    endpoint.use_hosts(["127.0.0.2"])
    assert [each.base[0] for each in endpoint.candidates] == ["127.0.0.2"]


async def test_plain_packets_come_by_a_short_way_and_everything_else_by_its_own(endpoint: Endpoint) -> None:
    camera = LocalMedia((VP8,), "sendonly", (MID_URI,))
    screen = LocalMedia((VP8,), "recvonly", (MID_URI,))
    async with Endpoint([HOST]) as other:
        watcher, sender = endpoint.connect(controlling=True), other.connect(controlling=False)
        assert not watcher.peer.receive_plain(b"\x80\x60" + bytes(20)), "not asked for"
        watcher.peer.media.plain = True
        assert not watcher.peer.receive_plain(b"\x80\x60" + bytes(20)), "no keys yet"
        offer = watcher.offer([OfferedMedia("camera", "video", screen)])
        watcher.accept(sender.answer(offer, {"camera": camera}))
        channel = watcher.open_channel("x")
        await until(watcher, of(ChannelOpened))
        for number in range(3):
            sender.send_frame("camera", [b"payload"], number * 3000)
            sender.send(channel, f"message {number}")
        heard: list[PeerEvent] = []
        while sum(isinstance(event, PlainRtp | ChannelMessage) for event in heard) < 6:
            heard.append(await anext(watcher))
        packets = [RtpPacket.parse(event.data) for event in heard if isinstance(event, PlainRtp)]
        assert [packet.timestamp - packets[0].timestamp for packet in packets] == [0, 3000, 6000]
        assert [event.data for event in heard if isinstance(event, ChannelMessage)] == [
            f"message {number}" for number in range(3)
        ]
        assert watcher.peer.receive_plain(b"\x80\x60" + bytes(20)), "somebody else's: dropped"
        assert watcher.peer.settled_events() == []
        watcher.close()
        assert not watcher.peer.receive_plain(b"\x80\x60" + bytes(20))


async def test_what_nothing_expected_of_one_peer_ends_its_connection_and_no_other(
    endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: told.append(context["message"]))
    async with Endpoint([HOST]) as one, Endpoint([HOST]) as another:
        pairs = []
        for other in (one, another):
            offerer, answerer = endpoint.connect(controlling=True), other.connect(controlling=False)
            offerer.accept(answerer.answer(offerer.offer(), {}))
            pairs.append((offerer, answerer))
        for offerer, answerer in pairs:
            await until(offerer, of(Connected))
            await until(answerer, of(Connected))
        (bad, of_bad), (good, of_good) = pairs

        def fails(*_: object) -> None:
            raise ZeroDivisionError("a fault of ours")

        monkeypatch.setattr(bad.peer, "receive_datagram", fails)
        of_bad.open_channel("x")
        assert await until_ended(bad) == PeerEnded("failed", "a fault of ours")
        assert told == ["serving a WebRTC peer failed"]
        for harmless in (bad.close, bad.flush):
            harmless()
        channel = of_good.open_channel("x")
        of_good.send(channel, "goes on")
        assert await until(good, of(ChannelMessage)) == ChannelMessage(channel, "goes on")


class FewTurns:
    """Turns that come when the test says so."""

    def __init__(self) -> None:
        self.at_once = True
        self.waiting: set[Connection] = set()

    def may_go_at_once(self) -> bool:
        return self.at_once

    def add(self, connection: Connection) -> None:
        self.waiting.add(connection)


async def test_what_a_peer_sends_waits_for_its_turn_and_no_more_than_the_bound_does() -> None:
    turns = FewTurns()
    settings = EndpointSettings(waiting_datagrams=5)
    async with Endpoint([HOST], settings=settings) as endpoint, Endpoint([HOST]) as other:
        offerer, answerer = other.connect(controlling=True), endpoint.connect(controlling=False, turns=turns)
        offerer.accept(answerer.answer(offerer.offer(), {}))
        await until(offerer, of(Connected))
        await until(answerer, of(Connected))
        channel = offerer.open_channel("x")
        await until(answerer, of(ChannelOpened))
        turns.at_once = False
        offerer.send(channel, "waits")
        while not turns.waiting:  # noqa: ASYNC110
            await asyncio.sleep(0.01)
        assert turns.waiting == {answerer}
        turns.at_once = True  # of no use while others wait: datagrams keep their order
        for number in range(20):
            offerer.send(channel, f"{number}")
            await asyncio.sleep(0.001)
        while not answerer.counts["receive_overflow"]:  # noqa: ASYNC110
            await asyncio.sleep(0.01)
        while answerer.handle_next():
            pass
        heard = [await until(answerer, of(ChannelMessage)) for _ in range(3)]
        assert heard[0] == ChannelMessage(channel, "waits")
        assert heard[1] == ChannelMessage(channel, "0")
        assert endpoint.dropped["receive_overflow"] == answerer.counts["receive_overflow"]
        answerer.close()
        assert endpoint.dropped["receive_overflow"] > 0, "of connections that have ended too"


async def test_each_answered_check_tells_its_round_trip(endpoint: Endpoint) -> None:
    async with Endpoint([HOST]) as other:
        offerer, answerer = endpoint.connect(controlling=True), other.connect(controlling=False)
        offerer.accept(answerer.answer(offerer.offer(), {}))
        for each in (offerer, answerer):
            found = await until(each, of(Answered))
            assert isinstance(found, Answered)
            assert 0 <= found.seconds < 1


async def test_a_listener_that_comes_later_hears_what_was_kept_for_it(endpoint: Endpoint) -> None:
    async with Endpoint([HOST]) as other:
        offerer, answerer = other.connect(controlling=True), endpoint.connect(controlling=False)
        offerer.accept(answerer.answer(offerer.offer(), {}))
        async with asyncio.timeout(10):
            await until(offerer, of(Connected))
        heard: list[PeerEvent] = []
        answerer.listen(heard.append)
        assert heard, "its path, at least"
        assert endpoint.connections == 1
        answerer.close()
        assert isinstance(heard[-1], PeerEnded)
        assert endpoint.connections == 0


async def test_nothing_can_be_sent_without_a_path_or_while_the_kernel_takes_no_more(endpoint: Endpoint) -> None:
    async with Endpoint([HOST]) as other:
        offerer, answerer = endpoint.connect(controlling=True), other.connect(controlling=False)
        blocked = [offerer.is_blocked]
        offerer.accept(answerer.answer(offerer.offer(), {}))
        async with asyncio.timeout(10):
            await until(offerer, of(Connected))
        blocked.append(offerer.is_blocked)
        for each in endpoint.sockets:
            each.is_full = True
        assert [*blocked, offerer.is_blocked] == [True, False, True]
