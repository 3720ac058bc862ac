"""Pictures of a robot of LeRobot: their stamps are never newer than the truth, and a camera that fails is a fault."""

import asyncio
import queue
import threading
import time
from contextlib import suppress

import numpy as np

from lockstep.protocol.description import Camera
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.robots.base import Stamp
from lockstep.robot_bridge.robots.lerobot.camera import ApartCamera, LeRobotCamera

CAMERA = Camera(name="front", label="Front", width=4, height=4, frame_rate=30)
PICTURE = np.zeros((4, 4, 3), np.uint8)


class Clocked:
    """Stamps each time with its own hundredth of a second, and knows nothing from before `since`."""

    def __init__(self, since: float = 0.0) -> None:
        self._since = since

    def __call__(self) -> Stamp:
        raise AssertionError("a picture of LeRobot is stamped with an earlier time")

    def at(self, time: float) -> Stamp | None:
        return None if time < self._since else Stamp(int(time * 100), time)


class Shots:
    """A camera whose pictures the test hands over; an exception is raised."""

    def __init__(self) -> None:
        self.next: queue.Queue[object] = queue.Queue()
        self._asked = 0
        self._asking = threading.Condition()

    def wait_until_asked(self, times: int) -> None:
        with self._asking:
            assert self._asking.wait_for(lambda: self._asked >= times, 10)

    def read(self) -> object:
        with self._asking:
            self._asked += 1
            self._asking.notify_all()
        found = self.next.get(timeout=10)
        if isinstance(found, Exception):
            raise found
        return found


async def first(camera: LeRobotCamera, stamp: Clocked) -> Media:
    came: asyncio.Future[Media] = asyncio.get_running_loop().create_future()

    def take(media: Media) -> None:
        if not came.done():
            came.set_result(media)

    running = asyncio.create_task(camera.run(stamp, take))
    try:
        return await asyncio.wait_for(came, 10)
    finally:
        running.cancel()
        with suppress(asyncio.CancelledError):
            await running


async def test_a_picture_has_the_stamp_of_its_capture_less_the_latency() -> None:
    camera = LeRobotCamera(CAMERA, latency=0.25, timeout=2)
    camera.put(PICTURE, 50.0)
    waiting = asyncio.create_task(first(camera, Clocked()))
    await asyncio.sleep(0)
    camera.put(PICTURE, 60.0)
    media = await waiting
    assert media.time in (49.75, 59.75)
    assert media.stamp == int(media.time * 100)
    assert (media.codec, media.width, media.height, len(media.payload)) == ("yuv420p", 4, 4, 24)


async def test_a_camera_read_apart_is_stamped_with_the_moment_of_the_picture_before_and_its_first_is_left_out() -> None:
    shots = Shots()
    camera = ApartCamera(CAMERA, latency=0.0, timeout=2, shots=shots)
    try:
        waiting = asyncio.create_task(first(camera, Clocked()))
        began = time.monotonic()
        shots.next.put(np.full((4, 4, 3), 255, np.uint8))
        await asyncio.to_thread(shots.wait_until_asked, 2)
        before = time.monotonic()
        shots.next.put(PICTURE)
        media = await waiting
        assert began <= media.time <= before  # it may have been taken at any time after the first was read
        assert media.payload[0] == 16
    finally:
        camera.close()
        shots.next.put(PICTURE)


async def test_a_picture_from_before_the_bridge_began_is_left_out() -> None:
    camera = LeRobotCamera(CAMERA, latency=0.0, timeout=2)
    waiting = asyncio.create_task(first(camera, Clocked(since=100.0)))
    await asyncio.sleep(0)
    camera.put(PICTURE, 50.0)
    await asyncio.sleep(0.05)  # longer than a frame
    camera.put(PICTURE, 101.0)
    assert (await waiting).time == 101.0


def test_a_camera_that_fails_or_is_silent_is_a_fault() -> None:
    shots = Shots()
    camera = ApartCamera(CAMERA, latency=0.0, timeout=2, shots=shots)
    try:
        now = time.monotonic()
        assert camera.faults(now) == ["front: no picture has come yet"]
        shots.next.put(PICTURE)
        shots.next.put(TimeoutError("no frame"))
        shots.next.put(PICTURE)
        deadline = time.monotonic() + 10
        while len(faults := camera.faults(time.monotonic())) != 1 or "yet" in faults[0]:
            assert time.monotonic() < deadline
        assert faults == ["front: TimeoutError: no frame"]
        assert "no picture for 6" in camera.faults(time.monotonic() + 60)[0]
    finally:
        camera.close()
        shots.next.put(PICTURE)
