"""Which of a stream's encodings is recorded: the operator's, a camera's own, the observers', else one made for it."""

import asyncio
import threading
from collections.abc import Callable
from itertools import groupby, pairwise
from typing import Any

import av
import pytest

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.h264 import inspect
from lockstep.server.media.codecs.packetise import split_nal_units
from lockstep.server.media.hub import MediaHub
from lockstep.server.media.pipeline.frame import EncodedFrame
from tests.server.media.camera_h264 import camera_pictures
from tests.server.media.feeding import timestamps, value
from tests.server.media.viewer import TIMEOUT, description, picture, running_plane, sound, viewing


class Taken:
    """What a recorder got."""

    def __init__(self, stream: str = "camera0") -> None:
        self._stream = stream
        self.frames: list[EncodedFrame] = []
        self.codecs: list[str] = []
        self._news = asyncio.Event()

    def __call__(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None:
        assert (stream, attached) == (self._stream, False)
        self.codecs.append(codec)
        self.frames.append(frame)
        self._news.set()

    @property
    def stamps(self) -> list[int]:
        return [frame.stamp for frame in self.frames]

    @property
    def steps(self) -> list[float]:
        """s from one to the next."""
        return [round(after.time - before.time, 4) for before, after in pairwise(self.frames)]

    async def feed(self, hub: MediaHub, media: list[Media]) -> None:
        """One by one, each when the one before was recorded."""
        for medium in media:
            self._news.clear()
            hub.feed(medium, medium.time)
            async with asyncio.timeout(TIMEOUT):
                await self._news.wait()

    async def hear(self, hub: MediaHub, media: list[Media]) -> None:
        """As `feed`. A resampler holds some sound back, so that the newest packets come later."""
        for medium in media:
            hub.feed(medium, medium.time)
            async with asyncio.timeout(TIMEOUT):
                while medium.stamp > 2 and (not self.frames or self.stamps[-1] < medium.stamp - 2):
                    self._news.clear()
                    await self._news.wait()


def encoded(hub: MediaHub, codec: str) -> float:
    return value(hub, "frames_encoded_total", stream="camera0", codec=codec)


def plain(first: int, last: int) -> list[Media]:
    return [picture(stamp, stamp / 30) for stamp in range(first, last + 1)]


def slices(picture: bytes) -> list[bytes]:
    """Without what a packetiser leaves out: supplemental information and delimiters."""
    return [nal.rstrip(b"\0") for nal in split_nal_units(picture) if nal[0] & 0x1F not in (6, 9)]


def decoded(frames: list[EncodedFrame]) -> int:
    decoder = av.CodecContext.create("h264", "r")
    found = [*(one for frame in frames for one in decoder.decode(av.Packet(frame.data))), *decoder.decode(None)]
    return len(found)


async def test_what_the_operator_gets_in_h264_is_recorded_and_encoded_once() -> None:
    taken = Taken()
    async with (
        running_plane(description(microphones=0)) as hub,
        viewing(hub, ["video"], priority=True) as operator,
    ):
        hub.record(taken)
        await taken.feed(hub, plain(1, 6))
        await operator.until(lambda: timestamps(operator, "video") == 6)
        assert taken.stamps == [1, 2, 3, 4, 5, 6]
        assert encoded(hub, "H264") == 6
        assert [slices(frame) for frame in operator.frames("video")] == [slices(frame.data) for frame in taken.frames]


@pytest.mark.parametrize("priority", [True, False])
async def test_where_all_take_vp8_that_is_recorded_and_nothing_is_encoded_for_it(priority: bool) -> None:
    """As it was sent, byte for byte; an operator's and an observer's."""
    taken = Taken()
    async with (
        running_plane(description(microphones=0)) as hub,
        viewing(hub, ["video"], codecs=["VP8"], priority=priority) as viewer,
    ):
        hub.record(taken)
        await taken.feed(hub, plain(1, 4))
        await viewer.until(lambda: timestamps(viewer, "video") == 4)
        assert (taken.stamps, set(taken.codecs)) == ([1, 2, 3, 4], {"VP8"})
        assert (encoded(hub, "H264"), encoded(hub, "VP8")) == (0, 4)
        assert viewer.frames("video") == [frame.data for frame in taken.frames]
        hub.record_keyframes()
        for medium in plain(5, 40):
            await taken.feed(hub, [medium])
            if taken.frames[-1].keyframe:
                break
        assert taken.frames[-1].keyframe


async def test_the_codec_changes_with_a_keyframe_when_who_takes_h264_goes_and_comes() -> None:
    taken = Taken()
    async with (
        running_plane(description(microphones=0)) as hub,
        viewing(hub, ["video"], codecs=["VP8"]),
    ):
        async with viewing(hub, ["video"], priority=True):
            hub.record(taken)
            await taken.feed(hub, plain(1, 4))
            assert taken.codecs == ["H264"] * 4
        await taken.feed(hub, plain(5, 30))
        assert taken.codecs[-1] == "VP8"
        before = encoded(hub, "H264")
        await taken.feed(hub, plain(31, 34))
        assert encoded(hub, "H264") == before
        async with viewing(hub, ["video"], priority=True):
            await taken.feed(hub, plain(35, 60))
        assert taken.codecs[-1] == "H264"
    assert sorted(set(taken.stamps)) == list(range(1, 61))  # one with which another begins may be there in both
    assert taken.stamps == sorted(taken.stamps)
    starts = [at for at in range(1, 60) if taken.codecs[at] != taken.codecs[at - 1]]
    assert len(starts) == 2
    assert all(taken.frames[at].keyframe for at in starts)


async def test_with_nobody_there_h264_is_made_until_somebody_takes_vp8() -> None:
    taken = Taken()
    async with running_plane(description(microphones=0)) as hub:
        hub.record(taken)
        await taken.feed(hub, plain(1, 3))
        assert (taken.codecs, encoded(hub, "H264")) == (["H264"] * 3, 3)
        async with viewing(hub, ["video"], codecs=["VP8"]):
            await taken.feed(hub, plain(4, 30))
            before = encoded(hub, "H264")
            await taken.feed(hub, plain(31, 34))
            assert (taken.codecs[-4:], encoded(hub, "H264")) == (["VP8"] * 4, before)
    assert sorted(set(taken.stamps)) == list(range(1, 35))


@pytest.mark.parametrize("codecs", [["H264"], ["VP8"]])
async def test_a_cameras_own_h264_is_recorded_as_it_came(codecs: list[str]) -> None:
    """Also when the operator takes another codec: nothing is encoded for the recording."""
    taken, pictures = Taken(), camera_pictures(8)
    async with (
        running_plane(description(microphones=0)) as hub,
        viewing(hub, ["video"], codecs=codecs, priority=True),
    ):
        hub.feed(pictures[0], 0.0)
        hub.record(taken)
        await taken.feed(hub, camera_pictures(8, first=2))
        assert taken.stamps == list(range(2, 10))
        assert [frame.data for frame in taken.frames] == [medium.payload for medium in pictures]
        assert [frame.time for frame in taken.frames] == [stamp / 30 for stamp in range(2, 10)]


async def test_with_nobody_there_a_cameras_own_h264_costs_no_encoder() -> None:
    taken = Taken()
    async with running_plane(description(microphones=0)) as hub:
        hub.record(taken)
        await taken.feed(hub, camera_pictures(1))  # what it gives was not known before
        await taken.feed(hub, camera_pictures(6, first=2))
        before = encoded(hub, "H264")
        await taken.feed(hub, camera_pictures(6, first=8))
        assert encoded(hub, "H264") == before <= 1
        assert taken.stamps == list(range(1, 14))


async def test_until_a_cameras_next_keyframe_ours_is_recorded() -> None:
    taken, pictures = Taken(), camera_pictures(9, gop=6)
    async with running_plane(description(microphones=0)) as hub:
        for medium in pictures[:3]:
            hub.feed(medium, medium.time)
        hub.record(taken)
        await taken.feed(hub, pictures[3:])
        assert taken.stamps == [4, 5, 6, 7, 8, 9]
        assert [inspect(frame.data).keyframe for frame in taken.frames] == [True, False, False, True, False, False]
        assert [frame.data for frame in taken.frames[3:]] == [medium.payload for medium in pictures[6:]]
        assert decoded(taken.frames) == 6


async def test_a_new_file_begins_with_a_keyframe_though_the_cameras_own_is_far() -> None:
    taken, pictures = Taken(), camera_pictures(8, gop=6)
    async with running_plane(description(microphones=0)) as hub:
        hub.feed(pictures[0], 0.0)
        hub.record(taken)
        await taken.feed(hub, camera_pictures(2, first=2, gop=6))
        hub.record_keyframes()
        del taken.frames[:]
        await taken.feed(hub, camera_pictures(8, first=2, gop=6)[2:])
        assert taken.frames[0].keyframe
        assert taken.stamps == [4, 5, 6, 7, 8, 9]
        assert decoded(taken.frames) == 6


async def test_whoever_asks_for_keyframes_without_a_new_file_waits_for_a_cameras_own() -> None:
    taken, pictures = Taken(), camera_pictures(8, first=2, gop=6)
    async with running_plane(description(microphones=0)) as hub:
        hub.feed(camera_pictures(1)[0], 0.0)
        hub.record(taken)
        await taken.feed(hub, pictures[:3])
        before = encoded(hub, "H264")
        hub.record_keyframes(afresh=False)
        await taken.feed(hub, pictures[3:])
        assert [frame.data for frame in taken.frames] == [medium.payload for medium in pictures]
        assert encoded(hub, "H264") == before


async def test_a_camera_that_gives_other_pictures_is_recorded_on() -> None:
    taken = Taken()
    async with running_plane(description(microphones=0)) as hub:
        hub.record(taken)
        await taken.feed(hub, camera_pictures(3))
        await taken.feed(hub, plain(4, 7))
        assert taken.stamps == [1, 2, 3, 4, 5, 6, 7]
        assert decoded(taken.frames) == 7
        hub.record(None)
        hub.feed(picture(8, 8 / 30), 8 / 30)
        assert len(taken.frames) == 7


def heard(first: int, last: int) -> list[Media]:
    """20 ms each."""
    return [sound(stamp, stamp * 0.02) for stamp in range(first, last + 1)]


def encoded_sound(hub: MediaHub, codec: str) -> float:
    return value(hub, "frames_encoded_total", stream="microphone0", codec=codec)


async def test_where_all_take_pcmu_that_is_recorded_and_no_opus_is_encoded_for_it() -> None:
    """As it was sent, byte for byte."""
    taken = Taken("microphone0")
    async with (
        running_plane(description(cameras=0)) as hub,
        viewing(hub, ["audio"], codecs=["PCMU"]) as viewer,
    ):
        hub.record(taken)
        await taken.hear(hub, heard(1, 6))
        await viewer.until(lambda: timestamps(viewer, "audio") == len(taken.frames))
        assert (taken.stamps, set(taken.codecs)) == (list(range(1, len(taken.frames) + 1)), {"PCMU"})
        assert (encoded_sound(hub, "opus"), encoded_sound(hub, "PCMU")) == (0, len(taken.frames))
        assert viewer.frames("audio") == [frame.data for frame in taken.frames]


@pytest.mark.parametrize("offered", [("opus", "PCMU"), ("PCMU", "opus")])
async def test_opus_is_recorded_where_somebody_takes_it_and_encoded_once(offered: tuple[str, ...]) -> None:
    taken = Taken("microphone0")
    async with (
        running_plane(description(cameras=0), sound_codecs=offered) as hub,
        viewing(hub, ["audio"], codecs=["PCMU"]),
        viewing(hub, ["audio"], codecs=["opus"]),
    ):
        hub.record(taken)
        await taken.hear(hub, heard(1, 5))
        assert (set(taken.steps), set(taken.codecs)) == ({0.02}, {"opus"})
        assert encoded_sound(hub, "opus") == len(taken.frames)


async def test_the_codec_of_sound_changes_with_who_listens_and_nothing_is_lost_or_there_twice() -> None:
    taken = Taken("microphone0")
    async with running_plane(description(cameras=0)) as hub:
        hub.record(taken)
        await taken.hear(hub, heard(1, 5))
        assert set(taken.codecs) == {"opus"}  # made for the recording
        async with viewing(hub, ["audio"], codecs=["PCMU"]):
            await taken.hear(hub, heard(6, 12))
            before = encoded_sound(hub, "opus")
            await taken.hear(hub, heard(13, 15))
            assert encoded_sound(hub, "opus") == before
            async with viewing(hub, ["audio"], codecs=["opus"]):
                await taken.hear(hub, heard(16, 25))
                assert taken.codecs[-1] == "opus"
            await taken.hear(hub, heard(26, 35))
            assert taken.codecs[-1] == "PCMU"
        await taken.hear(hub, heard(36, 45))
        assert taken.codecs[-1] == "opus"
    assert set(taken.steps) == {0.02}
    assert [codec for codec, _ in groupby(taken.codecs)] == ["opus", "PCMU", "opus", "PCMU", "opus"]


async def test_sound_in_long_segments_is_there_once_where_its_codec_changes() -> None:
    """Several packets of each codec come from one segment."""
    taken = Taken("microphone0")
    segments = [sound(stamp, stamp * 0.1, payload=sound(stamp, 0.0).payload * 5) for stamp in range(1, 13)]
    async with (
        running_plane(description(cameras=0)) as hub,
        viewing(hub, ["audio"], codecs=["PCMU"]),
    ):
        async with viewing(hub, ["audio"], codecs=["opus"]):
            hub.record(taken)
            await taken.hear(hub, segments[:4])
        await taken.hear(hub, segments[4:8])
        async with viewing(hub, ["audio"], codecs=["opus"]):
            await taken.hear(hub, segments[8:])
    assert [codec for codec, _ in groupby(taken.codecs)] == ["opus", "PCMU", "opus"]
    assert set(taken.steps) == {0.02}


async def test_a_clock_that_jumped_back_where_the_codec_changes_does_not_end_the_record() -> None:
    taken = Taken("microphone0")
    async with running_plane(description(cameras=0)) as hub:
        hub.record(taken)
        await taken.hear(hub, [sound(1, 5000.0), sound(2, 5000.02)])
        async with viewing(hub, ["audio"], codecs=["PCMU"]):
            await taken.hear(hub, heard(3, 10))
    assert taken.codecs[-1] == "PCMU"
    assert taken.steps[-3:] == [0.02] * 3


async def test_a_picture_that_is_encoded_while_another_epoch_begins_is_recorded_in_neither(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    taken, goes_on, told = Taken(), threading.Event(), threading.Event()
    async with running_plane(description(microphones=0)) as hub:
        hub.record(taken)
        await taken.feed(hub, plain(1, 2))
        worker = hub._streams["camera0"].worker
        work: Callable[..., None] = worker._work

        def late(*arguments: Any) -> None:
            goes_on.wait(TIMEOUT)
            work(*arguments)
            told.set()

        monkeypatch.setattr(worker, "_work", late)
        hub.feed(picture(3, 0.1), 0.1)
        hub.configure(description(microphones=0))
        goes_on.set()
        assert told.wait(TIMEOUT), "and the loop has had no turn since the epoch began"
        await taken.feed(hub, [picture(1, 0.2)])
        assert taken.stamps == [1, 2, 1]
