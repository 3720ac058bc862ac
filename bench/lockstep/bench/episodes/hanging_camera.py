"""The SO-101 with a camera that hangs: `lockstep robot lockstep.bench.episodes.hanging_camera:HangingCameraArm`.

SIGUSR1 makes the last camera hang, as a driver does that never returns from its read.
"""

import asyncio
import os
import signal
from collections.abc import Callable, Sequence

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.robots.base import MediaSource, Stamper
from lockstep.robot_bridge.robots.mujoco_view.graphics import choose_graphics
from lockstep.robot_bridge.robots.so101.model_source import arm_file

choose_graphics()  # before mujoco is imported

from lockstep.robot_bridge.robots.so101.robot import So101  # noqa: E402

__all__ = ["HangingCameraArm"]


class _Hanging(MediaSource):
    def __init__(self, source: MediaSource) -> None:
        self._source = source
        self.hangs = False

    async def run(self, stamp: Stamper, emit: Callable[[Media], None]) -> None:
        def pass_on(media: Media) -> None:
            if not self.hangs:
                emit(media)

        asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, self._hang)
        await self._source.run(stamp, pass_on)

    def _hang(self) -> None:
        self.hangs = True


class HangingCameraArm(So101):
    """The arm, whose last camera hangs once the process got SIGUSR1."""

    def __init__(self) -> None:
        super().__init__(arm_file(os.environ))
        *self._fine, last = super().sources()
        self._hanging = _Hanging(last)

    def sources(self) -> Sequence[MediaSource]:
        return (*self._fine, self._hanging)
