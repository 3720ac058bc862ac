"""The planar robot's sound: a quiet steady tone, and a motor hum that follows the speed."""

import asyncio
import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from robot_bridge.metronome import Metronome
from robot_bridge.protocol.messages import Media
from robot_bridge.robots.base import MediaSource, Stamp
from robot_bridge.robots.planar.description import MICROPHONE

if TYPE_CHECKING:
    from robot_bridge.robots.planar.robot import PlanarState

__all__ = ["SEGMENT_SAMPLES", "TONE_HZ", "PlanarMicrophone", "Synthesiser"]

SEGMENT_SECONDS = 0.02
SEGMENT_SAMPLES = round(MICROPHONE.sample_rate * SEGMENT_SECONDS)
TONE_HZ = 440.0  # always there, so that a test can tell sound from silence
TONE_LEVEL = 0.05  # of full scale
HUM_LEVEL = 0.25  # at full speed
HUM_HZ = (60.0, 160.0)  # standing, and per m/s on top


class Synthesiser:
    """Makes segments that join without a click."""

    def __init__(self) -> None:
        self._tone_phase = 0.0  # rad
        self._hum_phase = 0.0  # rad
        self._hum_level = 0.0
        self._steps = np.arange(1, SEGMENT_SAMPLES + 1)

    def segment(self, speed: float) -> bytes:
        """20 ms of pcm_s16le at `speed` (m/s)."""
        tone = self._tone_phase + self._steps * (math.tau * TONE_HZ / MICROPHONE.sample_rate)
        hum_step = math.tau * (HUM_HZ[0] + HUM_HZ[1] * speed) / MICROPHONE.sample_rate
        hum = self._hum_phase + self._steps * hum_step
        level = min(speed, 1.0) * HUM_LEVEL
        levels = np.linspace(self._hum_level, level, SEGMENT_SAMPLES)
        sound = TONE_LEVEL * np.sin(tone) + levels * (0.7 * np.sin(hum) + 0.3 * np.sin(2 * hum))
        self._tone_phase, self._hum_phase = float(tone[-1]) % math.tau, float(hum[-1]) % math.tau
        self._hum_level = level
        samples = (sound * 32767).astype("<i2")
        return bytes(samples.data)


class PlanarMicrophone(MediaSource):
    """A segment every 20 ms, stamped at its start and emitted at its end, as a real microphone would."""

    def __init__(self, state: "Callable[[], PlanarState]") -> None:
        self._state = state
        self._synthesiser = Synthesiser()

    async def run(self, stamp: Callable[[], Stamp], emit: Callable[[Media], None]) -> None:
        metronome = Metronome(SEGMENT_SECONDS, time.monotonic(), catch_up=2)
        while True:
            now, state = stamp(), self._state()
            await asyncio.sleep(metronome.wait(time.monotonic()))
            speed = math.hypot(state.vx, state.vy) + 0.3 * abs(state.wz)
            emit(
                Media(
                    stream=MICROPHONE.name,
                    codec="pcm_s16le",
                    stamp=now.event,
                    time=now.time,
                    payload=self._synthesiser.segment(speed),
                    sample_rate=MICROPHONE.sample_rate,
                    channels=MICROPHONE.channels,
                )
            )
