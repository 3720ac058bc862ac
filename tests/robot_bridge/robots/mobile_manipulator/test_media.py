"""Cameras and microphone: what they emit and how it is stamped."""

import asyncio
import threading
from collections.abc import Callable

import numpy as np
import pytest

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.robots.base import MediaSource, Stamp
from lockstep.robot_bridge.robots.microphone_source import SEGMENT_SECONDS
from lockstep.robot_bridge.robots.mobile_manipulator.description import CAMERAS, MICROPHONE
from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator
from lockstep.robot_bridge.robots.mujoco_view.renderer import Renderer
from tests.robot_bridge.robots.mobile_manipulator.driver import Driver
from tests.robot_bridge.robots.stamping import Stamping


class Clock:
    """Stamps with a new event each time and remembers on which thread."""

    def __init__(self) -> None:
        self.event = 0
        self.threads: set[int] = set()

    def stamp(self) -> Stamp:
        self.event += 1
        self.threads.add(threading.get_ident())
        return Stamp(self.event, asyncio.get_running_loop().time())


async def collect(source: MediaSource, stamp: Callable[[], Stamp], count: int) -> list[Media]:
    """The first `count` media of a source; the source's own errors are raised."""
    media: list[Media] = []
    enough = asyncio.Event()

    def emit(item: Media) -> None:
        media.append(item)
        if len(media) >= count:
            enough.set()

    async with asyncio.timeout(20), asyncio.TaskGroup() as group:
        running = group.create_task(source.run(Stamping(stamp), emit))
        await enough.wait()
        running.cancel()
    return media[:count]


@pytest.mark.parametrize("index", [0, 1])
async def test_a_camera_emits_pictures_of_its_size_that_show_something(robot: MobileManipulator, index: int) -> None:
    camera, clock = CAMERAS[index], Clock()
    media = await collect(robot.sources()[index], clock.stamp, 3)
    for picture in media:
        assert (picture.stream, picture.codec) == (camera.name, "yuv420p")
        assert (picture.width, picture.height) == (camera.width, camera.height)
        assert len(picture.payload) == camera.width * camera.height * 3 // 2
        planes = np.frombuffer(picture.payload, np.uint8)
        luma, chroma = np.split(planes, [camera.width * camera.height])
        assert luma.std() > 20
        assert 60 < luma.mean() < 220  # a bright lab
        assert chroma.std() > 3  # in colour
    assert [picture.stamp for picture in media] == [1, 2, 3]
    assert clock.threads == {threading.get_ident()}


async def test_a_picture_shows_the_state_at_its_stamp_and_the_sky_is_up(driver: Driver) -> None:
    renderer = Renderer(driver.robot.simulation.model, CAMERAS[0].width, CAMERAS[0].height)
    try:
        first = driver.robot.simulation.snapshot()
        before = await renderer.picture(CAMERAS[1], first)
        driver.run(1.0, tool_vz=0.2)
        after = await renderer.picture(CAMERAS[1], driver.robot.simulation.snapshot())
        again = await renderer.picture(CAMERAS[1], first)
    finally:
        renderer.close()
    assert before == again
    assert before != after
    rows = np.frombuffer(before, np.uint8)[: CAMERAS[1].width * CAMERAS[1].height].reshape(CAMERAS[1].height, -1)
    assert rows[:10].mean() > rows[-10:].mean() + 30  # bright sky above the dark palm


async def test_a_closed_renderer_draws_no_more(robot: MobileManipulator) -> None:
    renderer = Renderer(robot.simulation.model, 64, 48)
    renderer.close()
    with pytest.raises(RuntimeError):
        await renderer.picture(CAMERAS[0], robot.simulation.snapshot())


async def test_the_microphone_emits_20_ms_segments_stamped_at_their_start(robot: MobileManipulator) -> None:
    clock = Clock()
    media = await collect(robot.sources()[2], clock.stamp, 5)
    for segment in media:
        assert (segment.stream, segment.codec) == (MICROPHONE.name, "pcm_s16le")
        assert (segment.sample_rate, segment.channels) == (48_000, 1)
        assert len(segment.payload) == 2 * round(48_000 * SEGMENT_SECONDS)
        assert any(segment.payload)
    assert [segment.stamp for segment in media] == [1, 2, 3, 4, 5]  # the one that held before the sound was made


async def test_driving_is_louder_than_resting(driver: Driver) -> None:
    async def level(vx: float) -> float:
        def stamp() -> Stamp:
            driver.run(0.02, base_vx=vx)  # as much as one segment
            return Stamp(1, 0.0)

        media = await collect(driver.robot.sources()[2], stamp, 10)
        return float(np.std(np.frombuffer(b"".join(segment.payload for segment in media), "<i2")))

    resting = await level(0.0)
    assert await level(-0.5) > 2 * resting
