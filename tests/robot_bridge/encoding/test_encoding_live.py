"""A bridge that encodes, over real TCP: its pictures, stamps and keyframes, and what a full link does to them."""

import asyncio
import socket
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

import av
import msgspec
import pytest

from lockstep.protocol.actions import Status, StatusItem
from lockstep.protocol.framing import MAX_MEDIA_FRAME, FrameReader, frame
from lockstep.protocol.messages import (
    EncodeRequest,
    Hello,
    Media,
    Ping,
    Pong,
    StreamRequest,
    decode_message,
    encode_message,
)
from lockstep.protocol.traces.trace import known_spans
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play_all
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.encoding.encoder_choice import EncodeSettings, encode_settings
from lockstep.robot_bridge.errors import EncoderMissing, SettingsError
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import RecordingRobot, operator
from tests.waiting import PATIENCE

SETTINGS = BridgeSettings(port=0, encode=EncodeSettings(), event_strip=True)
CAMERAS = ("overview", "front")
CAMERA = CAMERAS[0]
BYTES_PER_SECOND = 15_000  # of a slow network


@asynccontextmanager
async def encoding_bridge(settings: BridgeSettings = SETTINGS) -> AsyncIterator[Bridge]:
    async with Bridge(RecordingRobot(media=True), settings) as bridge:
        yield bridge


async def pictures(link: RobotLink, count: int, stream: str = CAMERA) -> list[Media]:
    found: list[Media] = []
    async with asyncio.timeout(PATIENCE):
        async for message in link:
            if isinstance(message, Media) and message.stream == stream:
                found.append(message)
                if len(found) == count:
                    break
    return found


def ask_second(link: RobotLink, **fields: float) -> None:
    first, second = StreamRequest(stream=CAMERA), StreamRequest(stream=CAMERA, **fields)  # type: ignore[arg-type]
    link.send(EncodeRequest(streams=[first], second=[second]))


def ask(link: RobotLink, **fields: float) -> None:
    link.send(EncodeRequest(streams=[StreamRequest(stream=CAMERA, **fields)]))  # type: ignore[arg-type]


class Decoder:
    def __init__(self) -> None:
        self._context = av.CodecContext.create("h264", "r")
        self._context.thread_count = 1
        self._context.flags |= av.codec.context.Flags.low_delay

    def event_in(self, medium: Media) -> int | None:
        (picture,) = self._context.decode(av.Packet(medium.payload))
        return read_event_strip(picture.to_ndarray(format="gray"))


async def test_a_picture_is_stamped_with_the_event_that_it_shows() -> None:
    async with encoding_bridge() as bridge, RobotLink(*bridge.address, "media") as link:
        assert link.hello.encodes == ["h264", "opus"]
        ask(link, bitrate=2_000_000)
        async with operator(bridge) as driver:
            decoder, stamps = Decoder(), set()
            for _ in range(20):
                await driver.drive()
                for medium in await pictures(link, 2):
                    assert medium.codec == "h264"
                    assert decoder.event_in(medium) == medium.stamp
                    stamps.add(medium.stamp)
    assert len(stamps) > 10


async def test_a_picture_says_how_long_its_encoding_took_beside_what_was_measured_before() -> None:
    async with encoding_bridge() as bridge, RobotLink(*bridge.address, "media") as link:
        for medium in await pictures(link, 3):
            assert medium.spans is not msgspec.UNSET
            known = known_spans(medium.spans)
            assert {"capture_ms", "bridge_encode_ms", "link_wait_ms"} <= set(known)
            assert known["bridge_encode_ms"] > 0


async def test_a_link_begins_with_a_keyframe_and_gets_one_for_each_higher_count() -> None:
    async with encoding_bridge() as bridge, RobotLink(*bridge.address, "media") as link:
        assert (await pictures(link, 1))[0].keyframe
        assert not any(each.keyframe for each in await pictures(link, 10))
        for count in (1, 2):
            ask(link, keyframes=count)
            while not (await pictures(link, 1))[0].keyframe:
                pass
            ask(link, keyframes=count)  # a repeat
            assert not any(each.keyframe for each in await pictures(link, 10))
        async with RobotLink(*bridge.address, "media") as other:
            assert (await pictures(other, 1))[0].keyframe or any(each.keyframe for each in await pictures(other, 5))


async def test_size_and_rate_are_those_that_are_asked_for() -> None:
    async with encoding_bridge() as bridge, RobotLink(*bridge.address, "media") as link:
        whole = (await pictures(link, 1))[0]
        ask(link, bitrate=200_000, frame_rate=5, scale=0.5)
        while (first := (await pictures(link, 1))[0]).width == whole.width:
            pass
        assert (first.keyframe, first.width, first.height) == (True, whole.width // 2, whole.height // 2)
        times = [each.time for each in await pictures(link, 6)]
        assert (times[-1] - times[0]) / 5 > 0.15, "a camera of 30 Hz, of which 5 pictures a second are encoded"


async def test_requests_that_make_no_sense_change_nothing() -> None:
    async with encoding_bridge() as bridge, RobotLink(*bridge.address, "media") as link:
        link.send(EncodeRequest(streams=[StreamRequest(stream="no such camera", keyframes=2**53 - 1)] * 32))
        ask(link, bitrate=1, frame_rate=240, scale=1e-9)
        assert await pictures(link, 5)
        assert not bridge.counters.bad_input


async def test_a_bridge_that_does_not_encode_sends_raw_pictures_and_ignores_requests() -> None:
    async with (
        encoding_bridge(replace(SETTINGS, encode=None)) as bridge,
        RobotLink(*bridge.address, "media") as link,
    ):
        assert link.hello.encodes == []
        ask(link, bitrate=100_000)
        assert {each.codec for each in await pictures(link, 5)} == {"yuv420p"}


async def test_a_link_that_hardly_reads_costs_no_picture_that_another_needs() -> None:
    """What the slow link misses is counted, and nothing is left out for it."""
    async with encoding_bridge() as bridge, RobotLink(*bridge.address, "media") as link, slow_link(bridge) as slow:
        decoder = Decoder()
        while not (medium := (await pictures(link, 1))[0]).keyframe:
            pass
        decoder.event_in(medium)
        async with asyncio.timeout(PATIENCE):
            while not bridge.drops[CAMERA]:
                await slow.read()
                for medium in await pictures(link, 1):
                    assert decoder.event_in(medium) == medium.stamp


async def test_pictures_are_left_out_before_they_are_encoded_while_no_link_takes_them() -> None:
    """All that were encoded can be decoded in order, although the link took a fraction of what the camera gave."""
    async with encoding_bridge() as bridge, slow_link(bridge) as slow:
        decoder, shown = Decoder(), 0
        async with asyncio.timeout(PATIENCE):
            while shown < 30 or not bridge.counters.left_out["link_busy"]:
                await asyncio.sleep(0.01)
                for message in await slow.read():
                    if message.stream == CAMERA:
                        assert decoder.event_in(message) == message.stamp
                        shown += 1
    assert not set(bridge.drops) & set(CAMERAS)


class SlowLink:
    """A media link whose network brings few bytes a second. `beat` says that its client lives, whatever comes.

    The bridge ends a link on which nothing moves for a second. So the bytes are counted by the clock: on a busy machine
    fewer calls read more each.
    """

    def __init__(self, own: socket.socket) -> None:
        self._socket = own
        self._reader = FrameReader(MAX_MEDIA_FRAME)
        self._read_at = time.monotonic()

    async def send(self, message: Hello | EncodeRequest | Ping | Pong) -> None:
        await asyncio.get_running_loop().sock_sendall(self._socket, frame(encode_message(message)))

    async def beat(self) -> None:
        while True:
            await self.send(Ping(id=1))
            await asyncio.sleep(0.2)

    async def read(self) -> list[Media]:
        """Read what came since the last call."""
        before, self._read_at = self._read_at, time.monotonic()
        size = max(1, int(BYTES_PER_SECOND * (self._read_at - before)))
        data = await asyncio.get_running_loop().sock_recv(self._socket, size)
        assert data, "the bridge has ended the link"
        self._reader.feed(data)
        messages = [decode_message(bytes(payload)) for payload in self._reader.frames()]
        for each in messages:
            if isinstance(each, Ping):
                await self.send(Pong(id=each.id))
        return [each for each in messages if isinstance(each, Media)]


@asynccontextmanager
async def slow_link(bridge: Bridge) -> AsyncIterator[SlowLink]:
    with socket.socket() as own:
        own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        own.setblocking(False)
        await asyncio.get_running_loop().sock_connect(own, bridge.address)
        link = SlowLink(own)
        await link.send(Hello(role="media"))
        await link.send(EncodeRequest(streams=[StreamRequest(stream=name, bitrate=20_000_000) for name in CAMERAS]))
        async with asyncio.TaskGroup() as tasks:
            beating = tasks.create_task(link.beat())
            yield link
            beating.cancel()


async def test_a_bridge_that_encodes_keeps_to_the_protocol() -> None:
    cases = [case for case in CASES if case.name in ("hello", "permissions", "malformed", "media_role", "stamps")]
    async with encoding_bridge() as bridge:
        results = await play_all(Subject(Place(*bridge.address)), cases, lambda result: None)
    assert [(each.case.name, each.detail) for each in results if each.outcome != Outcome.OK] == []


def test_the_extra_is_named_where_pyav_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(EncoderMissing, match=r"lockstep-bridge\[encode\]"):
        encode_settings("h264")


def test_an_encoder_that_does_not_exist_is_refused_by_name() -> None:
    with pytest.raises(SettingsError, match="h265"):
        encode_settings("h265")


async def second_pictures(link: RobotLink, count: int) -> list[Media]:
    found: list[Media] = []
    async with asyncio.timeout(PATIENCE):
        async for message in link:
            if isinstance(message, Media) and message.second:
                found.append(message)
                if len(found) == count:
                    break
    return found


async def test_a_link_that_asks_gets_a_second_encoding_of_its_own_size_with_true_stamps_and_others_get_none() -> None:
    async with (
        encoding_bridge() as bridge,
        RobotLink(*bridge.address, "media") as link,
        RobotLink(*bridge.address, "media") as other,
    ):
        assert link.hello.encodings == 2
        assert not any(medium.second for medium in await pictures(link, 5))
        ask_second(link, bitrate=900_000, scale=0.75)
        found, others = await asyncio.gather(second_pictures(link, 10), pictures(other, 20))
        assert found[0].keyframe
        decoder = Decoder()
        assert all(decoder.event_in(medium) == medium.stamp for medium in found)
        assert {medium.stream for medium in found} == {CAMERA}
        firsts = await pictures(link, 4)
        assert {each.width for each in found} == {round(0.75 * max(each.width for each in firsts))}
        assert not any(medium.second for medium in others)


async def status_item(link: RobotLink, name: str) -> StatusItem:
    async with asyncio.timeout(PATIENCE):
        async for message in link:
            for item in message.items if isinstance(message, Status) else ():
                if item.name == name:
                    return item
    raise AssertionError("the link ended")


async def test_an_encoder_that_is_not_there_is_said_in_the_status_before_any_picture_was_taken(
    caplog: pytest.LogCaptureFixture,
) -> None:
    settings = replace(SETTINGS, encode=EncodeSettings("h264_of_nobody"))
    async with encoding_bridge(settings) as bridge, RobotLink(*bridge.address, "operator") as link:
        item = await status_item(link, "encoder_fallback")
        assert (item.name, item.value, item.level) == ("encoder_fallback", "libx264", "warning")
        assert item.text.startswith("h264_of_nobody cannot be opened")
    said = [record.getMessage() for record in caplog.records if "encoder_fallback" in record.getMessage()]
    assert len(said) == 1, "two cameras have two encoders each, and the trial has one; the fact is one"
    assert said[0].startswith("encoder_fallback: h264_of_nobody cannot be opened")
