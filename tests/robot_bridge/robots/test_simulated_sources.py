"""What the cameras and microphones of all simulated robots do alike."""

import asyncio
import itertools

from lockstep.protocol.description import Camera, Microphone
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.robots.base import MediaSource, Stamp
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.microphone_source import MicrophoneSource
from tests.robot_bridge.robots.stamping import Stamping

CAMERA = Camera(name="camera", label="Camera", width=64, height=48, frame_rate=200.0)
MICROPHONE = Microphone(name="microphone", label="Microphone", sample_rate=48_000)


class Events:
    """Stamps with a new event each time."""

    def __init__(self) -> None:
        self._numbers = itertools.count(1)
        self.last = 0

    def __call__(self) -> Stamp:
        self.last = next(self._numbers)
        return Stamp(self.last, asyncio.get_running_loop().time())


async def collect(source: MediaSource, events: Events, count: int) -> list[Media]:
    media: list[Media] = []
    enough = asyncio.Event()

    def emit(item: Media) -> None:
        media.append(item)
        if len(media) >= count:
            enough.set()

    async with asyncio.timeout(20), asyncio.TaskGroup() as group:
        running = group.create_task(source.run(Stamping(events), emit))
        await enough.wait()
        running.cancel()
    return media[:count]


async def test_while_a_picture_is_drawn_the_loop_runs_and_no_other_is_begun() -> None:
    drawing: list[int] = []
    begun, go_on = asyncio.Event(), asyncio.Event()

    async def draw(state: str, event: int) -> bytes:
        drawing.append(event)
        begun.set()
        await go_on.wait()
        return b""

    events = Events()
    async with asyncio.timeout(20), asyncio.TaskGroup() as group:
        collecting = group.create_task(collect(CameraSource(CAMERA, draw, lambda: "state"), events, 3))
        await begun.wait()
        for _ in range(10):
            await asyncio.sleep(0)
        assert (drawing, events.last) == ([1], 1)
        go_on.set()
        media = await collecting
    assert [picture.stamp for picture in media] == [1, 2, 3]


async def test_a_picture_shows_the_state_that_held_at_its_stamp() -> None:
    events = Events()
    media = await collect(
        CameraSource(CAMERA, lambda state, event: b"%d %d" % (state, event), lambda: events.last), events, 3
    )
    assert [picture.payload for picture in media] == [b"1 1", b"2 2", b"3 3"]
    assert {(picture.width, picture.height, picture.codec) for picture in media} == {(64, 48, "yuv420p")}


async def test_a_segment_is_stamped_before_what_is_heard_in_it_and_emitted_after() -> None:
    events = Events()
    media = await collect(MicrophoneSource(MICROPHONE, lambda: b"%d" % events.last), events, 3)
    assert [(segment.stamp, segment.payload) for segment in media] == [(1, b"1"), (2, b"2"), (3, b"3")]


async def test_what_was_heard_before_the_microphone_ran_is_thrown_away() -> None:
    heard: list[str] = []

    def segment() -> bytes:
        heard.append("segment")
        return b""

    await collect(MicrophoneSource(MICROPHONE, segment, begin=lambda: heard.append("begin")), Events(), 2)
    assert heard[:3] == ["begin", "segment", "segment"]
