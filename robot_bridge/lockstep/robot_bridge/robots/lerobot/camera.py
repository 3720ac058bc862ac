"""The cameras of a robot of LeRobot, each stamped with the event that held when its picture was taken, or before.

LeRobot does not say when a picture was taken. It came after the picture that was read last, so that the moment of that
reading, less the time that the camera itself needs, is a safe one: a stamp may be older than the truth, never newer.
"""

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from lockstep.protocol.description import Camera
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.robots.base import MediaSource, Stamper
from lockstep.robot_bridge.robots.lerobot.bus_loop import BusLoop
from lockstep.robot_bridge.robots.lerobot.device import Shots
from lockstep.robot_bridge.robots.lerobot.picture import BadPicture, to_yuv
from lockstep.robot_bridge.thread_name import name_thread

__all__ = ["ApartCamera", "LeRobotCamera", "TogetherCamera"]

PAUSE = 0.1  # s after a reading that failed
EARLY = 0.7  # of the frame interval: a camera's own rate is never quite even
BAD_SHOWN = 3.0  # s


class Shot(NamedTuple):
    picture: Any
    captured: float  # s, monotonic: the picture is no older than this
    arrived: float


class LeRobotCamera(MediaSource):
    """Keeps the newest picture, which another thread brings, and sends it. A faulty camera is a fault of the robot."""

    def __init__(self, camera: Camera, latency: float, timeout: float) -> None:
        """`latency`: s from the exposure until LeRobot has the picture."""
        self._camera = camera
        self._latency = latency
        self._timeout = timeout
        self._newest: Shot | None = None
        self._bad: tuple[str, float] | None = None
        self._came = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None

    def faults(self, now: float) -> list[str]:
        name, newest, bad = self._camera.name, self._newest, self._bad
        found = [] if bad is None or now - bad[1] > BAD_SHOWN else [f"{name}: {bad[0]}"]
        if newest is None:
            return [*found, f"{name}: no picture has come yet"]
        if now - newest.arrived > self._timeout:
            found.append(f"{name}: no picture for {now - newest.arrived:.1f} s")
        return found

    async def run(self, stamp: Stamper, emit: Callable[[Media], None]) -> None:
        self._loop = asyncio.get_running_loop()
        if self._newest is not None:
            self._came.set()
        camera, sent = self._camera, 0.0
        try:
            while True:
                await self._came.wait()
                self._came.clear()
                shot = self._newest
                if shot is None or shot.arrived - sent < EARLY / camera.frame_rate:
                    continue
                sent = shot.arrived
                at = stamp.at(shot.captured - self._latency)
                if at is None:
                    continue  # from before the bridge began
                try:
                    payload = await asyncio.to_thread(to_yuv, shot.picture, camera.width, camera.height)
                except BadPicture as error:
                    self._refuse(str(error))
                    continue
                emit(
                    Media(
                        stream=camera.name,
                        codec="yuv420p",
                        stamp=at.event,
                        time=at.time,
                        payload=payload,
                        width=camera.width,
                        height=camera.height,
                    )
                )
        finally:
            self._loop = None

    def put(self, picture: Any, captured: float) -> None:
        """Take a picture, in any thread. The newest wins."""
        self._newest = Shot(picture, captured, time.monotonic())
        loop = self._loop
        if loop is not None:
            try:
                loop.call_soon_threadsafe(self._came.set)
            except RuntimeError:  # the loop has just closed
                self._loop = None

    def _refuse(self, what: str) -> None:
        self._bad = (what, time.monotonic())

    def close(self) -> None:
        """End what brings the pictures. Does not wait."""


class ApartCamera(LeRobotCamera):
    """A camera that a thread of its own reads."""

    def __init__(self, camera: Camera, latency: float, timeout: float, shots: Shots) -> None:
        super().__init__(camera, latency, timeout)
        self._shots = shots
        self._leave = threading.Event()
        self._thread = threading.Thread(target=self._read_on, name="lerobot camera", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._leave.set()

    def _read_on(self) -> None:
        name_thread("lerobot-camera")
        since: float | None = None  # when the picture before was read; nobody knows how old the first one is
        while not self._leave.is_set():
            try:
                picture = self._shots.read()
            except Exception as error:
                self._refuse(f"{type(error).__name__}: {error}"[:200])
                self._leave.wait(PAUSE)
                continue
            now = time.monotonic()
            if since is not None:
                self.put(picture, since)
            since = now


class TogetherCamera(LeRobotCamera):
    """A camera whose pictures come with the state."""

    def take(self, bus: BusLoop) -> None:
        """Take the picture of the newest state, in the bus' thread."""
        state = bus.newest
        if state is not None and self._camera.name in state.pictures:
            self.put(state.pictures[self._camera.name], state.time)
