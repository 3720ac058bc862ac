"""The micromanipulator's sound: a tone that follows the rate of the steps, and another that follows the force."""

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.micromanipulator.description import MICROPHONE
from lockstep.robot_bridge.robots.microphone_source import SEGMENT_SECONDS

__all__ = ["SEGMENT_SAMPLES", "Sound"]

SEGMENT_SAMPLES: Final = round(MICROPHONE.sample_rate * SEGMENT_SECONDS)
HUM_HZ: Final = 110.0  # the lamp's supply, always there
HUM_LEVEL: Final = 0.015  # of full scale
FULL_RATE: Final = 2500.0  # steps per second
STEP_LEVEL: Final = 0.16
CONTACT_HZ: Final = (330.0, 660.0)  # at the lightest touch, and on top at full force
CONTACT_LEVEL: Final = 0.12
LIGHTEST: Final = 0.5e-6  # N, the first contact that is heard
LOUDEST: Final = 400e-6  # N

Signal = npt.NDArray[np.floating[Any]]


class Sound:
    """Makes segments that join without a click: phases go on, levels and pitches glide."""

    def __init__(self) -> None:
        self._steps = np.arange(1, SEGMENT_SAMPLES + 1)
        self._ramp = self._steps / SEGMENT_SAMPLES
        self._hum = self._step_phase = self._contact_phase = 0.0  # rad
        self._step_level = self._contact_level = 0.0
        self._contact_pitch = CONTACT_HZ[0]

    def segment(self, step_rate: float, force: float) -> bytes:
        """Return 20 ms of pcm_s16le at a rate of steps per second and a force in N."""
        hum, self._hum = self._phases(self._hum, HUM_HZ)
        # Steps come too fast to be heard one by one; a drive sounds with its rate, as stepper motors do.
        step, self._step_phase = self._phases(self._step_phase, max(40.0, step_rate / 2))
        strength = _strength(force)
        pitch = CONTACT_HZ[0] + CONTACT_HZ[1] * strength
        contact, self._contact_phase = self._phases(self._contact_phase, (self._contact_pitch + pitch) / 2)
        self._contact_pitch = pitch
        step_levels, self._step_level = self._levels(
            self._step_level, STEP_LEVEL * math.sqrt(min(1.0, step_rate / FULL_RATE))
        )
        contact_levels, self._contact_level = self._levels(
            self._contact_level, CONTACT_LEVEL * (0.3 + 0.7 * strength) if strength else 0.0
        )
        sound = (
            HUM_LEVEL * np.sin(hum)
            + step_levels * (0.6 * np.sin(step) + 0.3 * np.sin(2 * step) + 0.15 * np.sin(3 * step))
            + contact_levels * (0.8 * np.sin(contact) + 0.2 * np.sin(2 * contact))
        )
        return (sound * 32767).astype("<i2").tobytes()

    def _phases(self, phase: float, pitch: float) -> tuple[Signal, float]:
        phases = phase + self._steps * (math.tau * pitch / MICROPHONE.sample_rate)
        return phases, float(phases[-1]) % math.tau

    def _levels(self, before: float, level: float) -> tuple[Signal, float]:
        return before + (level - before) * self._ramp, level


def _strength(force: float) -> float:
    """Return the loudness of a force, 0 to 1, by the logarithm: a hundredth of full force is to be heard as well."""
    if force <= LIGHTEST:
        return 0.0
    return min(1.0, 0.05 + 0.95 * math.log(force / LIGHTEST) / math.log(LOUDEST / LIGHTEST))
