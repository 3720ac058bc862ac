"""Whole endpoints with Chromium, which has every stack of its own."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import count

import pytest
from playwright.async_api import Page

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.rtc.channels import ChannelMessage, ChannelOpened
from lockstep.rtc.endpoint import Connection, Endpoint
from lockstep.rtc.interfaces import own_addresses
from lockstep.rtc.peer import OfferedMedia
from lockstep.rtc.peer_events import Connected, MediaEvent, PacketReceived, PeerEnded, PeerEvent
from lockstep.rtc.rtp.stage import KeyframeRequested, Reception
from lockstep.rtc.rtp.wire.extensions import ABS_SEND_TIME_URI
from lockstep.rtc.sdp import MID_URI, Codec, LocalMedia, parse_description, write_description
from tests.rtc.vp8 import packetise

pytestmark = pytest.mark.browser

VP8 = Codec(96, "VP8", 90_000, feedback=("nack", "nack pli", "goog-remb"))
RTX = Codec(97, "rtx", 90_000, parameters={"apt": "96"})
OPUS = Codec(111, "opus", 48_000, 2)
URIS = (MID_URI, ABS_SEND_TIME_URI)
DECODES = """async () => {
    for (;;) {
        const found = [...(await pc.getStats()).values()].filter(each => each.type === "inbound-rtp");
        if (found.reduce((sum, each) => sum + (each.framesDecoded ?? 0), 0) >= 5) return;
        await new Promise(resolve => setTimeout(resolve, 50));
    }
}"""
PREPARE = """() => {
    globalThis.pc = new RTCPeerConnection();
    globalThis.heard = [];
    const listen = channel => {
        channel.onmessage = event => { heard.push(event.data); channel.send("echo " + event.data); };
    };
    pc.ondatachannel = event => listen(event.channel);
    globalThis.listen = listen;
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 64;
    let shade = 0;
    setInterval(() => {
        const context = canvas.getContext("2d");
        context.fillStyle = `rgb(${shade++ % 256}, 0, 0)`;
        context.fillRect(0, 0, 64, 64);
    }, 40);
    globalThis.track = canvas.captureStream(25).getVideoTracks()[0];
}"""


@pytest.fixture
async def page() -> AsyncIterator[Page]:
    async with running_chromium() as browser:
        page = await browser.new_page()
        await page.evaluate(PREPARE)
        yield page


@pytest.fixture
async def endpoint() -> AsyncIterator[Endpoint]:
    async with Endpoint(["127.0.0.1"]) as found:
        yield found


async def until(connection: Connection, *wanted: Callable[[PeerEvent], bool]) -> list[PeerEvent]:
    """The first event for each of `wanted`, whatever their order."""
    found: dict[int, PeerEvent] = {}
    async for event in connection:
        assert not isinstance(event, PeerEnded), event
        for place, each in enumerate(wanted):
            if place not in found and each(event):
                found[place] = event
        if len(found) == len(wanted):
            break
    return [found[place] for place in range(len(wanted))]


def is_a(kind: type) -> Callable[[PeerEvent], bool]:
    return lambda event: isinstance(event, kind)


def tells(kind: type) -> Callable[[PeerEvent], bool]:
    return lambda event: isinstance(event, MediaEvent) and isinstance(event.event, kind)


async def show(connection: Connection, page: Page, mid: str) -> None:
    """Send pictures until the page has decoded some."""
    async with sending(connection, mid, list(packetise(30))):
        await page.evaluate(DECODES)


@asynccontextmanager
async def sending(connection: Connection, mid: str, pictures: list[list[bytes]]) -> AsyncIterator[None]:
    """Inside the block, send these pictures over and over at their own pace: the first may come before it listens."""

    async def send() -> None:
        for number in count():
            connection.send_frame(mid, pictures[number % len(pictures)], number * 3000)
            await asyncio.sleep(1 / 30)

    async with asyncio.TaskGroup() as group:
        task = group.create_task(send())
        yield
        task.cancel()


async def check_media_and_messages(connection: Connection, page: Page, video: str, channel: int) -> None:
    connection.send(channel, "hello")
    [echo, packet] = await until(
        connection, lambda event: event == ChannelMessage(channel, "echo hello"), is_a(PacketReceived)
    )
    assert isinstance(packet, PacketReceived)
    assert packet.mid == video
    assert set(packet.packet.values) <= set(URIS)
    assert ABS_SEND_TIME_URI in packet.packet.values
    await show(connection, page, video)
    [told] = await until(connection, tells(Reception))
    assert isinstance(told, MediaEvent)
    connection.request_keyframe(video)
    await page.evaluate("() => pc.close()")
    assert [event async for event in connection][-1] == PeerEnded("peer_closed")


async def test_chromium_offers_pictures_sound_and_a_channel(endpoint: Endpoint, page: Page) -> None:
    connection = endpoint.connect(controlling=False)
    offer = parse_description(
        await page.evaluate("""async () => {
            pc.addTransceiver(track, {direction: "sendrecv"});
            pc.addTransceiver("audio", {direction: "recvonly"});
            listen(pc.createDataChannel("theirs"));
            await pc.setLocalDescription();
            return pc.localDescription.sdp;
        }""")
    )
    media = {
        section.mid: LocalMedia((VP8, RTX, OPUS), "sendrecv", URIS, msid=f"ours {section.kind}")
        for section in offer.sections
    }
    answer = connection.answer(offer, media)
    assert [section.rejected for section in answer.sections] == [False, False, False]
    await page.evaluate("sdp => pc.setRemoteDescription({type: 'answer', sdp})", write_description(answer))
    [_, opened] = await until(connection, is_a(Connected), is_a(ChannelOpened))
    assert isinstance(opened, ChannelOpened)
    assert opened.label == "theirs"
    await check_media_and_messages(connection, page, offer.sections[0].mid, opened.channel)


async def test_chromium_answers_our_offer(endpoint: Endpoint, page: Page) -> None:
    connection = endpoint.connect(controlling=True)
    camera = OfferedMedia("camera", "video", LocalMedia((VP8, RTX), "sendrecv", URIS, msid="ours camera"))
    sound = OfferedMedia("sound", "audio", LocalMedia((OPUS,), "sendonly", URIS, msid="ours sound"))
    answer = await page.evaluate(
        """async sdp => {
            await pc.setRemoteDescription({type: "offer", sdp});
            const video = pc.getTransceivers()[0];
            await video.sender.replaceTrack(track);
            video.direction = "sendrecv";
            await pc.setLocalDescription();
            return pc.localDescription.sdp;
        }""",
        write_description(connection.offer([camera, sound])),
    )
    connection.accept(parse_description(answer))
    await until(connection, is_a(Connected))
    channel = connection.open_channel("ours")
    await until(connection, is_a(ChannelOpened))
    await check_media_and_messages(connection, page, "camera", channel)


async def test_chromium_asks_for_a_keyframe_when_the_first_is_lost(endpoint: Endpoint, page: Page) -> None:
    connection = endpoint.connect(controlling=True)
    camera = OfferedMedia("camera", "video", LocalMedia((VP8,), "sendonly", URIS, msid="ours camera"))
    answer = await page.evaluate(
        """async sdp => {
            await pc.setRemoteDescription({type: "offer", sdp});
            await pc.setLocalDescription();
            return pc.localDescription.sdp;
        }""",
        write_description(connection.offer([camera])),
    )
    connection.accept(parse_description(answer))
    await until(connection, is_a(Connected))
    async with sending(connection, "camera", list(packetise(20))[1:]):  # without the keyframe
        await until(connection, tells(KeyframeRequested))


async def test_chromium_connects_by_tcp_where_no_udp_gets_out(page: Page) -> None:
    async with Endpoint(own_addresses()[:1], tcp=True) as endpoint:
        connection = endpoint.connect(controlling=False)
        offer = parse_description(
            await page.evaluate("""async () => {
                pc.addTransceiver(track, {direction: "sendrecv"});
                listen(pc.createDataChannel("theirs"));
                await pc.setLocalDescription();
                return pc.localDescription.sdp;
            }""")
        )
        media = {each.mid: LocalMedia((VP8, RTX), "sendrecv", URIS, msid="ours camera") for each in offer.sections}
        answer = write_description(connection.answer(offer, media))
        lines = [each for each in answer.splitlines() if not (each.startswith("a=candidate") and " udp " in each)]
        await page.evaluate("sdp => pc.setRemoteDescription({type: 'answer', sdp})", "\r\n".join([*lines, ""]))
        [_, opened] = await until(connection, is_a(Connected), is_a(ChannelOpened))
        assert connection.peer.ice.path is not None
        assert connection.peer.ice.path.transport == "tcp"
        assert isinstance(opened, ChannelOpened)
        await check_media_and_messages(connection, page, offer.sections[0].mid, opened.channel)
