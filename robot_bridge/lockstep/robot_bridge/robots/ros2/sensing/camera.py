"""Pictures of a topic, stamped with the event that held when they were captured."""

import asyncio
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from lockstep.protocol.framing import MAX_MEDIA_FRAME
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.base import MediaSource, Stamper
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide, header_ns
from lockstep.robot_bridge.robots.ros2.sensing.capture_time import ClockMismatch, captured_at
from lockstep.robot_bridge.robots.ros2.sensing.latest_message import Newest
from lockstep.robot_bridge.robots.ros2.sensing.picture import BadPicture, Payload, from_compressed, from_image
from lockstep.robot_bridge.robots.ros2.settings import CameraTopic

__all__ = ["CameraSource"]

MAX_PAYLOAD = MAX_MEDIA_FRAME - 4096  # room for the rest of the message
EARLY = 0.7  # of the frame interval: a camera's own rate is never quite even


class _Shot(NamedTuple):
    message: Any
    captured: float  # s, monotonic, as stamps are
    arrived: float  # s, on the clock that counts suspended time, as ages are


class CameraSource(MediaSource):
    """Receives messages in the node's thread, keeps the newest, and converts it in another thread."""

    def __init__(self, ros: RosSide, settings: CameraTopic) -> None:
        self._ros = ros
        self._settings = settings
        self._convert = from_image if settings.message == "Image" else from_compressed
        self._shots: Newest[_Shot] = Newest(settings.topic, settings.timeout)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._came = asyncio.Event()
        ros.subscribe(ros.interface(f"sensor_msgs/msg/{settings.message}"), settings.topic, self._take)

    @property
    def newest(self) -> Newest[Any]:
        """The newest picture, and the faults of the topic."""
        return self._shots

    def faults(self, now: float) -> list[str]:
        return self._shots.faults(now)

    async def run(self, stamp: Stamper, emit: Callable[[Media], None]) -> None:
        settings = self._settings
        self._loop = asyncio.get_running_loop()
        try:
            while True:
                await self._came.wait()
                self._came.clear()
                arrived = self._shots.last()
                if arrived is None:
                    continue
                shot = arrived.value
                at = stamp.at(shot.captured)
                if at is None:
                    self._shots.refuse("picture from before the bridge began", shot.arrived)
                    continue
                payload = await asyncio.to_thread(self._payload, shot)
                if payload is not None:
                    emit(
                        Media(
                            stream=settings.name,
                            codec=payload.codec,
                            stamp=at.event,
                            time=at.time,
                            payload=payload.data,
                            width=settings.width,
                            height=settings.height,
                        )
                    )
        finally:
            self._loop = None

    def _take(self, message: Any) -> None:
        """Receive a message in the node's thread; the two clocks are read as close to each other as possible."""
        settings, monotonic, now_ros = self._settings, time.monotonic(), self._ros.now_ns()
        now = clock.now()
        header = header_ns(message.header)
        last = self._shots.last()
        if last is not None and now - last.time < EARLY / settings.frame_rate:
            return
        try:
            captured = captured_at(
                settings.captured, arrived=monotonic, arrived_ros=now_ros, header=header, latency=settings.latency
            )
        except ClockMismatch as error:
            self._shots.refuse(str(error), now)
            return
        if self._shots.put(_Shot(message, captured, now), now, header) and self._loop is not None:
            self._loop.call_soon_threadsafe(self._came.set)

    def _payload(self, shot: _Shot) -> Payload | None:
        settings = self._settings
        try:
            payload = self._convert(shot.message, settings.width, settings.height)
        except BadPicture as error:
            self._shots.refuse(str(error), shot.arrived)
            return None
        if len(payload.data) > MAX_PAYLOAD:
            self._shots.refuse("picture too large to be sent", shot.arrived)
            return None
        return payload
