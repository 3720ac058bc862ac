import asyncio
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager

import pytest

from lockstep.client.media.decoder import Decoded
from lockstep.client.media.frame_assembler import MediaPacket
from lockstep.client.media.media_gate import GateMode, MediaGate
from lockstep.client.media.newest_queue import NewestQueue, QueueClosed
from lockstep.client.media.stream import ENCODED_BOUND, Stream
from lockstep.protocol.carriers import Carrier, append_trailer
from tests.client.pictures import encode

VP8, H264 = 97, 99


class Shown:
    """What the stream said it rendered."""

    def __init__(self) -> None:
        self.third = asyncio.Event()
        self._count = 0

    def __call__(self, stream: str, stamp: int) -> None:
        self._count += 1
        if self._count == 3:
            self.third.set()


def new_stream(shown: Shown, carrier: Carrier = "native", tolerance: int = 4, gate: GateMode = "event") -> Stream:
    return Stream("front", "video", {VP8: "VP8", H264: "H264"}, carrier, MediaGate(tolerance, gate), shown)


def packet(sequence: int, data: bytes, stamp: int | None) -> MediaPacket:
    return MediaPacket(sequence, sequence * 3000, True, data, stamp)


@asynccontextmanager
async def running(stream: Stream, bound: int = 50) -> AsyncIterator[NewestQueue[Decoded]]:
    with stream.readers.open(bound) as reader, ThreadPoolExecutor(1) as executor:
        async with asyncio.TaskGroup() as group, asyncio.timeout(20):
            task = group.create_task(stream.run(executor))
            yield reader
            task.cancel()


async def test_pictures_come_out_decoded_and_gated() -> None:
    stream = new_stream(Shown(), tolerance=1)
    stream.feedback(3)
    async with running(stream) as reader:
        for number, data in enumerate(encode("VP8", 5), start=1):
            stream.packet(VP8, packet(number, data, number))
        assert [(await reader.get()).stamp for _ in range(3)] == [2, 3, 4]
        stream.feedback(4)
        assert (await reader.get()).stamp == 5
    figures = stream.statistics()
    assert (figures.codec, figures.frames, figures.rendered, figures.discarded) == ("VP8", 5, 4, 1)
    assert figures.max_gap == 1


async def test_the_trailer_is_taken_off_and_gives_the_stamp() -> None:
    stream = new_stream(Shown(), "trailer")
    stream.feedback(7)
    async with running(stream) as reader:
        for number, data in enumerate(encode("H264", 3)):
            stream.packet(H264, packet(number, append_trailer(data, 7 + number, 123456), None))
        assert [(await reader.get()).stamp for _ in range(3)] == [7, 8, 9]


async def test_a_frame_without_its_trailer_is_not_shown() -> None:
    stream = new_stream(Shown(), "trailer")
    stream.feedback(1)
    first, second = encode("VP8", 2)
    async with running(stream) as reader:
        stream.packet(VP8, packet(0, first, 1))
        stream.packet(VP8, packet(1, append_trailer(second, 1, 1), None))
        assert (await reader.get()).timestamp == 3000
    assert (stream.statistics().unstamped, stream.statistics().discarded) == (1, 1)


async def test_a_decoder_that_fails_starts_over_with_a_keyframe() -> None:
    stream = new_stream(Shown())
    stream.feedback(1)
    pictures = encode("VP8", 4, every=3)
    broken = pictures[0][:10] + b"\xff" * 5
    async with running(stream) as reader:
        stream.packet(VP8, packet(0, broken, 1))
        for _ in range(2000):
            if stream.packet(VP8, packet(1, b"\x01" + bytes(20), 1)):
                break  # it asks for a keyframe
            await asyncio.sleep(0.001)
        for number, data in enumerate(pictures, start=2):
            stream.packet(VP8, packet(number, data, 1))
        assert (await reader.get()).stamp == 1


async def test_a_decoder_that_is_too_slow_drops_everything_up_to_a_keyframe() -> None:
    stream = new_stream(Shown())
    stream.feedback(1)
    pictures = encode("VP8", ENCODED_BOUND + 3, every=ENCODED_BOUND + 2)
    for number, data in enumerate(pictures):
        stream.packet(VP8, packet(number, data, 1))
    async with running(stream) as reader:
        assert (await reader.get()).timestamp == 3000 * (ENCODED_BOUND + 2)
    assert stream.statistics().dropped == ENCODED_BOUND


async def test_frames_that_come_together_behind_a_dropped_one_are_dropped_with_it() -> None:
    """A lost packet that comes at last completes many frames at once; those behind the overflow build on lost ones."""
    stream = new_stream(Shown())
    stream.feedback(1)
    keyframe = ENCODED_BOUND + 4
    pictures = encode("VP8", keyframe + 1, every=keyframe)
    async with running(stream) as reader:
        stream.packet(VP8, packet(0, pictures[0], 1))
        assert (await reader.get()).timestamp == 0
        for number in [*range(2, keyframe), 1, keyframe]:
            stream.packet(VP8, packet(number, pictures[number], 1))
        assert (await reader.get()).timestamp == 3000 * keyframe


async def test_packets_of_an_unknown_payload_type_are_left_out() -> None:
    stream = new_stream(Shown())
    assert not stream.packet(55, packet(0, b"x", 1))
    assert stream.statistics().packets == 0


async def test_a_closed_stream_ends_its_readers_and_opens_no_more() -> None:
    stream = new_stream(Shown())
    with stream.readers.open(2) as early:
        stream.close()
        with stream.readers.open(2) as late:
            for reader in (early, late):
                with pytest.raises(QueueClosed):
                    await reader.get()


async def test_what_a_reader_lost_is_counted_after_it_is_gone() -> None:
    shown = Shown()
    stream = new_stream(shown)
    stream.feedback(1)
    async with running(stream, bound=1) as reader:
        for number, data in enumerate(encode("VP8", 3)):
            stream.packet(VP8, packet(number, data, 1))
        await shown.third.wait()
        assert reader.dropped == 2
    assert stream.statistics().dropped == 2


async def test_the_log_says_how_old_each_rendering_was() -> None:
    gate: MediaGate[Decoded] = MediaGate(4, "off")
    stream = Stream("front", "video", {VP8: "VP8"}, "capture-time", gate, Shown(), lambda: 100.0)
    first, second = encode("VP8", 2)
    async with running(stream) as reader:
        stream.packet(VP8, MediaPacket(0, 0, True, first, 1, 99.0))
        stream.packet(VP8, MediaPacket(1, 3000, True, second, 1, 99.9))
        taken = [await reader.get(), await reader.get()]
    assert [medium.captured for medium in taken] == [99.0, 99.9]
    assert [(entry.stamp, round(entry.age or 0, 3)) for entry in stream.log.all()] == [(1, 1.0), (1, 0.1)]
    assert (gate.rendered, gate.discarded) == (2, 0)


async def test_sound_that_plays_or_is_too_old_is_noted_and_sound_that_overtook_the_feedback_is_not() -> None:
    heard: list[int] = []
    last = asyncio.Event()

    def on_heard(microphone: str, stamp: int) -> None:
        assert microphone == "microphone"
        heard.append(stamp)
        if stamp == 12:
            last.set()

    gate: MediaGate[Decoded] = MediaGate(2)
    stream = Stream("microphone", "audio", {0: "PCMU"}, "native", gate, Shown(), on_heard=on_heard)
    stream.feedback(10)
    async with running(stream):
        for number, stamp in enumerate([1, 8, 20, 12]):
            stream.packet(0, MediaPacket(number, number * 160, True, b"\xff" * 160, stamp))
        await last.wait()
    assert heard == [1, 8, 12]


async def test_sound_that_nobody_reads_is_not_heard() -> None:
    heard: list[int] = []
    rendered = asyncio.Event()
    gate: MediaGate[Decoded] = MediaGate(2)
    stream = Stream(
        "microphone",
        "audio",
        {0: "PCMU"},
        "native",
        gate,
        lambda *_: rendered.set(),
        on_heard=lambda _, stamp: heard.append(stamp),
    )
    stream.feedback(10)
    with ThreadPoolExecutor(1) as executor:
        async with asyncio.TaskGroup() as group, asyncio.timeout(20):
            task = group.create_task(stream.run(executor))
            stream.packet(0, MediaPacket(0, 0, True, b"\xff" * 160, 10))
            await rendered.wait()
            rendered.clear()
            with stream.readers.open(50):
                stream.packet(0, MediaPacket(1, 160, True, b"\xff" * 160, 9))
                await rendered.wait()
            task.cancel()
    assert heard == [9]
