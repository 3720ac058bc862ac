"""The stage that encodes in a thread."""

import asyncio
import threading
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from typing import NoReturn

import pytest

from lockstep.server.media.codecs.packetise import packetise_h264
from lockstep.server.media.encoding.encoder_worker import Encoded, EncoderWorker
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.errors import EncodeError, MediaError, PayloadError
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.stage import SourceFrame
from tests.server.media.pipeline.collecting import Collector, Counted, arrive
from tests.server.media.viewer import TIMEOUT, picture


class NewestFirst:
    """A queue of one."""

    def __init__(self) -> None:
        self.newest: SourceFrame | None = None

    def put(self, frame: SourceFrame) -> None:
        self.newest = frame

    def next_job(self) -> int | None:
        newest, self.newest = self.newest, None
        return None if newest is None else newest.media.stamp


class Stamps:
    """An encoder whose frames are the stamps; 13 is a bad picture."""

    def __init__(self, encoding: TierEncoding) -> None:
        self.encoding = encoding
        self.error: MediaError = PayloadError("13")
        self.threads: set[str] = set()
        self.goes_on = threading.Event()
        self.goes_on.set()

    def encode(self, job: int) -> Sequence[Encoded]:
        self.threads.add(threading.current_thread().name)
        self.goes_on.wait(TIMEOUT)
        if job == 13:
            return [Encoded(self.encoding, (), error=self.error)]
        frame = EncodedFrame(
            b"x", packetise_h264, keyframe=True, marker=True, stamp=job, capture_time=0.0, media_time=0
        )
        return [Encoded(self.encoding, (frame,), 0.001)]


class End(Collector):
    def __init__(self) -> None:
        super().__init__()
        self.came = asyncio.Event()

    def encoded(self, frame: EncodedFrame, encoding: TierEncoding) -> None:
        super().encoded(frame, encoding)
        self.came.set()


class World(Counted):
    def __init__(self) -> None:
        super().__init__()
        self.all = self.encodings("H264", "VP8")
        self.encoder = Stamps(self.all.own.get("H264", "operator"))
        self.end = End()
        self.worker = EncoderWorker(self.end, NewestFirst(), self.encoder, self.all, self.dropped)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        task = asyncio.create_task(self.worker.run())
        await asyncio.sleep(0)
        try:
            yield
        finally:
            task.cancel()
            self.encoder.goes_on.set()
            with suppress(asyncio.CancelledError):
                await task

    async def take(self, stamp: int) -> None:
        self.end.came.clear()
        arrive(self.worker, picture(stamp, stamp / 30))
        async with asyncio.timeout(TIMEOUT):
            await self.end.came.wait()

    @property
    def stamps(self) -> list[int]:
        return [frame.stamp for frame, _ in self.end.frames]


async def test_frames_are_encoded_in_its_own_thread_and_those_that_came_before_it_ran_too() -> None:
    world = World()
    arrive(world.worker, picture(1, 0.0))
    async with world.running():
        async with asyncio.timeout(TIMEOUT):
            await world.end.came.wait()
        await world.take(2)
    assert world.stamps == [1, 2]
    assert [name.startswith("media-camera0") for name in world.encoder.threads] == [True]


async def test_a_bad_picture_is_counted_by_its_name_and_the_next_one_passes() -> None:
    world = World()
    async with world.running():
        await world.take(1)
        world.encoder.goes_on.clear()
        arrive(world.worker, picture(13, 1.0), picture(2, 1.1))  # the first is begun at once, the second waits
        world.encoder.goes_on.set()
        world.end.came.clear()
        async with asyncio.timeout(TIMEOUT):
            await world.end.came.wait()
    assert world.stamps == [1, 2]
    assert world.drops("bad_payload") == 1


@pytest.mark.parametrize(
    ("error", "drives", "others"),
    [
        (PayloadError("no picture"), True, [False]),
        (PayloadError("no picture"), False, [True]),
        (EncodeError("x"), True, []),
    ],
)
async def test_only_a_picture_that_cannot_be_decoded_asks_the_robot_for_a_keyframe_and_the_operators_come_first(
    error: MediaError, drives: bool, others: list[bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    world, asked = World(), list[bool]()
    world.all.join("H264", world.subscription(priority=drives))
    if not drives:
        world.all.join("VP8", world.subscription(priority=True))
    passed = world.all.add_passed()
    monkeypatch.setattr(passed, "request_keyframe", lambda cause, *, other: asked.append(other))
    world.encoder.error = error
    async with world.running():
        arrive(world.worker, picture(13, 1.0))
        await world.take(2)
    assert asked == others


async def test_nothing_passes_after_the_end_and_it_can_run_again() -> None:
    world = World()
    async with world.running():
        world.encoder.goes_on.clear()
        arrive(world.worker, picture(1, 0.0))
    await asyncio.sleep(0)
    assert world.stamps == []
    async with world.running():
        await world.take(2)
    assert world.stamps == [2]


async def test_a_picture_for_which_there_was_no_room_for_a_thread_is_counted_and_does_not_keep_the_next_ones_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world, asked = World(), list[str]()
    passed = world.all.add_passed()
    monkeypatch.setattr(passed, "request_keyframe", lambda cause, *, other: asked.append(cause))
    async with world.running():
        with pytest.MonkeyPatch.context() as patch:

            def refuse(thread: threading.Thread) -> NoReturn:
                raise RuntimeError("can't start new thread")

            patch.setattr(threading.Thread, "start", refuse)
            arrive(world.worker, picture(1, 0.0))  # which ends no task of whoever brings pictures
        assert world.drops("worker_failed") == 1
        assert asked == ["drop"]
        await world.take(2)
        await world.take(3)
    assert world.stamps == [2, 3]
