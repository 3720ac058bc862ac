"""The planar robot with a microphone that hears a short tone twice a second, at known times."""

import math
import time
from collections.abc import Sequence

import numpy as np

from lockstep.robot_bridge.robots.base import MediaSource
from lockstep.robot_bridge.robots.microphone_source import SEGMENT_SECONDS, MicrophoneSource
from lockstep.robot_bridge.robots.planar.description import MICROPHONE
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot

__all__ = ["TICK_HZ", "TICK_PERIOD", "TICK_SECONDS", "TickingRobot"]

TICK_PERIOD = 0.5  # s; a tick begins whenever this machine's monotonic clock is a multiple of it
TICK_SECONDS = 0.004
TICK_HZ = 2000.0
LEVEL = 0.5  # of full scale
SAMPLES = round(MICROPHONE.sample_rate * SEGMENT_SECONDS)


class TickingRobot(PlanarRobot):
    """Its microphone's segments follow one another without a hole, from the moment when listening begins."""

    def __init__(self) -> None:
        super().__init__()
        self._heard = 0.0  # s on the monotonic clock: the end of the last segment

    def sources(self) -> Sequence[MediaSource]:
        cameras = [source for source in super().sources() if not isinstance(source, MicrophoneSource)]
        return (*cameras, MicrophoneSource(MICROPHONE, self._tick_segment, self._begin))

    def _begin(self) -> None:
        self._heard = time.monotonic()

    def _tick_segment(self) -> bytes:
        since = (self._heard + np.arange(SAMPLES) / MICROPHONE.sample_rate) % TICK_PERIOD
        self._heard += SEGMENT_SECONDS
        sound = np.where(since < TICK_SECONDS, LEVEL * np.sin(math.tau * TICK_HZ * since), 0.0)
        return (sound * 32767).astype("<i2").tobytes()
