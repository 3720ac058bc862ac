"""The planar robot's sound: a quiet steady tone, and a motor hum that follows the speed."""

import math

import numpy as np

from lockstep.robot_bridge.robots.microphone_source import SEGMENT_SECONDS
from lockstep.robot_bridge.robots.planar.description import MICROPHONE

__all__ = ["SEGMENT_SAMPLES", "TONE_HZ", "Synthesiser"]

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
        """Return 20 ms of pcm_s16le at `speed` (m/s)."""
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
