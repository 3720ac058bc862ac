"""A camera of a simulated robot: pictures at a fixed rate, each of the state at one instant."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

from lockstep.protocol.description import Camera
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.control.ticks.ticker import Ticker
from lockstep.robot_bridge.robots.base import MediaSource, Stamp

__all__ = ["CameraSource"]

State = TypeVar("State")


class CameraSource(MediaSource, Generic[State]):
    """Takes the stamp and the state at one instant on the loop, and draws the picture.

    A `draw` that takes less than a millisecond may return the bytes and so runs on the loop; a slower one returns an
    awaitable and draws in a thread. At most one picture is drawn at a time: if drawing falls behind, the beats missed
    meanwhile are skipped.
    """

    def __init__(
        self, camera: Camera, draw: Callable[[State, int], bytes | Awaitable[bytes]], state: Callable[[], State]
    ) -> None:
        """`draw`: draws a state and, if it is to be shown, the event, as yuv420p. `state`: returns the present one."""
        self._camera = camera
        self._draw = draw
        self._state = state

    async def run(self, stamp: Callable[[], Stamp], emit: Callable[[Media], None]) -> None:
        metronome = Ticker(1 / self._camera.frame_rate, time.monotonic())
        while True:
            await asyncio.sleep(metronome.wait(time.monotonic()))
            now, state = stamp(), self._state()
            drawn = self._draw(state, now.event)
            emit(
                Media(
                    stream=self._camera.name,
                    codec="yuv420p",
                    stamp=now.event,
                    time=now.time,
                    payload=drawn if isinstance(drawn, bytes) else await drawn,
                    width=self._camera.width,
                    height=self._camera.height,
                )
            )
