"""Sound of the robot out of what the physics let hear: motors, rubbing, knocks, and a fan that never stops.

Every voice keeps its phase and lets its level and pitch glide, so that segments join without a click. Samples are
single precision: sines are several times cheaper so, and the error is far below the last of sixteen bits.
"""

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from robot_bridge.robots.mobile_manipulator.hearing import Heard

__all__ = ["Sound"]

Signal = npt.NDArray[np.floating[Any]]  # single precision

FAN_LEVEL: Final = 0.012  # of full scale; audible, never disturbing
FAN_TONE: Final = 116.0  # Hz
KNOCK_MODES: Final = (
    (140.0, 16.0, 0.6),
    (390.0, 28.0, 0.5),
    (930.0, 50.0, 0.3),
    (2150.0, 90.0, 0.15),
)  # Hz, 1/s, share
NOISE_SECONDS: Final = 3


class Motor:
    """A whining tone with harmonics whose pitch and level follow a speed."""

    def __init__(self, rest_pitch: float, pitch: float, level: float, full_speed: float, harmonics: int) -> None:
        self._rest_pitch = rest_pitch  # Hz
        self._pitch = pitch  # Hz at full speed, on top
        self._level = level
        self._full_speed = full_speed
        self._orders = np.arange(1, harmonics + 1, dtype=np.float32)[:, None]
        self._shares = 1 / (self._orders[:, 0] + np.float32(0.5))
        self._phase = 0.0
        self._last = 0.0  # share of full speed at the end of the last segment

    def play(self, speed: float, steps: Signal, seconds: float) -> Signal:
        share = min(1.0, speed / self._full_speed)
        if share == self._last == 0.0:
            self._phase = (self._phase + 2 * math.pi * seconds * self._rest_pitch) % (2 * math.pi)
            return np.zeros(len(steps), np.float32)
        glide = self._last + (share - self._last) * steps
        travelled = (self._last + glide) / 2 * steps  # integral of the glide
        phase = self._phase + 2 * np.pi * seconds * (self._rest_pitch * steps + self._pitch * travelled)
        self._phase = float(phase[-1] % (2 * np.pi))
        self._last = share
        if not glide.any():
            return np.zeros(len(steps), np.float32)
        tone: Signal = self._shares @ np.sin(self._orders * phase)
        return self._level * np.sqrt(glide) * tone  # type: ignore[no-any-return]


class Noise:
    """Noise of a band, out of a loop made in the frequency domain so that its ends meet."""

    def __init__(self, rate: int, low: float, high: float, seed: int) -> None:
        length = rate * NOISE_SECONDS
        frequencies = np.fft.rfftfreq(length, 1 / rate)
        shape = np.exp(-0.5 * (np.log(np.maximum(frequencies, 1.0) / np.sqrt(low * high)) / np.log(high / low)) ** 2)
        phases = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, len(frequencies))
        loop = np.fft.irfft(shape * np.exp(1j * phases), length)
        self._loop: Signal = (loop / loop.std()).astype(np.float32)
        self._position = 0

    def play(self, count: int) -> Signal:
        begin = self._position
        self._position = (begin + count) % len(self._loop)
        if begin < self._position:
            return self._loop[begin : self._position]
        return np.concatenate((self._loop[begin:], self._loop[: self._position]))


class Sound:
    """Makes one segment after the other; each takes what was heard during it."""

    def __init__(self, rate: int, samples: int) -> None:
        self._samples = samples
        self._seconds = samples / rate
        self._steps: Signal = np.arange(1, samples + 1, dtype=np.float32) / samples
        self._wheels = Motor(55.0, 190.0, 0.16, 0.6, 4)
        self._arm = Motor(150.0, 420.0, 0.10, 1.5, 3)
        self._wrist = Motor(310.0, 800.0, 0.06, 2.5, 3)
        self._fan_noise = Noise(rate, 150.0, 900.0, seed=1)
        self._rub_noise = Noise(rate, 500.0, 3500.0, seed=2)
        self._fan_phase = 0.0
        self._rubbing = 0.0
        times = np.arange(1, samples + 1) / rate
        self._modes = np.array([np.exp((2j * np.pi * pitch - decay) * times) for pitch, decay, _ in KNOCK_MODES])
        self._shares = np.array([share for _, _, share in KNOCK_MODES])
        self._ringing = np.zeros(len(KNOCK_MODES), dtype=complex)

    def segment(self, heard: Heard) -> bytes:
        """The next segment, pcm_s16le mono."""
        steps, seconds = self._steps, self._seconds
        signal = (
            self._fan(steps, seconds)
            + self._wheels.play(heard.wheels, steps, seconds)
            + self._arm.play(heard.arm, steps, seconds)
            + self._wrist.play(heard.wrist, steps, seconds)
            + self._rub(heard.rubbing, steps)
            + self._knock(heard.knocks)
        )
        return (np.tanh(signal) * 32000.0).astype("<i2").tobytes()

    def _fan(self, steps: Signal, seconds: float) -> Signal:
        phase = self._fan_phase + 2 * np.pi * FAN_TONE * seconds * steps
        self._fan_phase = float(phase[-1] % (2 * np.pi))
        return FAN_LEVEL * (0.5 * np.sin(phase) + 0.6 * self._fan_noise.play(self._samples))  # type: ignore[no-any-return]

    def _rub(self, rubbing: float, steps: Signal) -> Signal:
        level = min(0.14, 0.03 * math.sqrt(max(rubbing - 0.05, 0.0)))
        glide = self._rubbing + (level - self._rubbing) * steps
        self._rubbing = level
        return glide * self._rub_noise.play(self._samples)

    def _knock(self, knocks: float) -> Signal:
        # A mode is the imaginary part of a decaying phasor: struck with a real amount it starts from zero.
        self._ringing = self._ringing + self._shares * min(0.7, knocks / 300.0)
        signal: Signal = (self._ringing @ self._modes).imag.astype(np.float32)
        self._ringing = self._ringing * self._modes[:, -1]
        return signal
