"""Makes the robot's sound from the events of the physics: motors, rubbing, knocks, and a fan that never stops.

Every voice keeps its phase and lets its level and pitch glide, so that segments join without a click. Samples are
single precision: sines are several times cheaper that way, and the error is far below the last of sixteen bits.
"""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.mobile_manipulator.hearing import Heard

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
UNHEARD: Final = 1e-6  # of full scale
LOOP_SECONDS: Final = 3


class Motor(NamedTuple):
    """A whining tone with harmonics whose pitch and level follow a speed."""

    rest_pitch: float  # Hz
    pitch: float  # Hz at full speed, on top
    level: float
    full_speed: float
    harmonics: int


MOTORS: Final = (Motor(55.0, 190.0, 0.16, 0.6, 4), Motor(150.0, 420.0, 0.10, 1.5, 3), Motor(310.0, 800.0, 0.06, 2.5, 3))


class Motors:
    """Plays all motors at once: the cost is in the number of calls, not of samples."""

    def __init__(self, motors: Sequence[Motor], steps: Signal, seconds: float) -> None:
        """`steps`: the part of a segment that has passed at each of its samples."""
        self._steps = steps
        self._seconds = seconds
        self._motors = motors
        self._rest_pitch = column([each.rest_pitch for each in motors])
        self._pitch = column([each.pitch for each in motors])
        orders = [order for each in motors for order in range(1, each.harmonics + 1)]
        self._orders = column(orders)
        self._owners = np.repeat(np.arange(len(motors)), [each.harmonics for each in motors])
        self._shares = np.zeros((len(motors), len(orders)), np.float32)  # of each motor's level in each harmonic
        self._shares[self._owners, np.arange(len(orders))] = 1 / (self._orders[:, 0] + 0.5)
        self._shares *= column([each.level for each in motors])
        self._phases = [0.0] * len(motors)
        self._last = [0.0] * len(motors)  # share of full speed at the end of the last segment

    def play(self, speeds: Sequence[float]) -> Signal | float:
        """Return the sound of the next segment; 0 for silence."""
        shares = [min(1.0, speed / each.full_speed) for speed, each in zip(speeds, self._motors, strict=True)]
        if not any(shares) and not any(self._last):
            turned = (2 * math.pi * self._seconds * each.rest_pitch for each in self._motors)
            self._phases = [(phase + turn) % (2 * math.pi) for phase, turn in zip(self._phases, turned, strict=True)]
            return 0.0
        last = column(self._last)
        glides = last + (column(shares) - last) * self._steps
        travelled = (last + glides) * (self._steps / 2)  # integrals of the glides
        turns = self._rest_pitch * self._steps + self._pitch * travelled
        phases = column(self._phases) + np.float32(2 * np.pi * self._seconds) * turns
        self._phases = (phases[:, -1] % np.float32(2 * np.pi)).tolist()
        self._last = shares
        tones = self._shares @ np.sin(self._orders * phases[self._owners])
        return np.einsum("ij,ij->j", np.sqrt(glides), tones)  # type: ignore[no-any-return]


def column(values: Sequence[float]) -> Signal:
    return np.array(values, np.float32)[:, None]


class Loop:
    """A sound that repeats without a click: its ends meet."""

    def __init__(self, loop: Signal) -> None:
        self._loop = loop
        self._position = 0

    def play(self, count: int) -> Signal:
        begin = self._position
        self._position = (begin + count) % len(self._loop)
        if begin < self._position:
            return self._loop[begin : self._position]
        return np.concatenate((self._loop[begin:], self._loop[: self._position]))


def noise(rate: int, low: float, high: float, seed: int) -> Signal:
    """Return noise of a band, made in the frequency domain so that its ends meet; its mean square is 1."""
    length = rate * LOOP_SECONDS
    frequencies = np.fft.rfftfreq(length, 1 / rate)
    shape = np.exp(-0.5 * (np.log(np.maximum(frequencies, 1.0) / np.sqrt(low * high)) / np.log(high / low)) ** 2)
    phases = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, len(frequencies))
    loop = np.fft.irfft(shape * np.exp(1j * phases), length)
    return (loop / loop.std()).astype(np.float32)  # type: ignore[no-any-return]


def fan(rate: int) -> Signal:
    """Return a hum in its own wind; whole turns of it fill the loop."""
    hum = np.sin(2 * np.pi * FAN_TONE / rate * np.arange(rate * LOOP_SECONDS))
    return (FAN_LEVEL * (0.5 * hum + 0.6 * noise(rate, 150.0, 900.0, seed=1))).astype(np.float32)  # type: ignore[no-any-return]


class Sound:
    """Makes one segment after the other, each from the sounds heard in its time."""

    def __init__(self, rate: int, samples: int) -> None:
        self._samples = samples
        self._steps: Signal = np.arange(1, samples + 1, dtype=np.float32) / samples
        self._motors = Motors(MOTORS, self._steps, samples / rate)
        self._fan = Loop(fan(rate))
        self._rub_noise = Loop(noise(rate, 500.0, 3500.0, seed=2))
        self._rubbing = 0.0
        times = np.arange(1, samples + 1) / rate
        self._modes = np.array([np.exp((2j * np.pi * pitch - decay) * times) for pitch, decay, _ in KNOCK_MODES])
        self._shares = np.array([share for _, _, share in KNOCK_MODES])
        self._ringing = np.zeros(len(KNOCK_MODES), dtype=complex)
        self._rings = False

    def segment(self, heard: Heard) -> bytes:
        """Return the next segment, pcm_s16le mono."""
        signal: Signal = self._fan.play(self._samples) + self._motors.play((heard.wheels, heard.arm, heard.wrist))
        level = min(0.14, 0.03 * math.sqrt(max(heard.rubbing - 0.05, 0.0)))
        if level or self._rubbing:
            signal += (self._rubbing + (level - self._rubbing) * self._steps) * self._rub_noise.play(self._samples)
            self._rubbing = level
        if heard.knocks or self._rings:
            signal += self._knock(heard.knocks)
        return (np.tanh(signal) * np.float32(32000.0)).astype("<i2").tobytes()

    def _knock(self, knocks: float) -> Signal:
        # A mode is the imaginary part of a decaying phasor: struck with a real amount it starts from zero.
        self._ringing = self._ringing + self._shares * min(0.7, knocks / 300.0)
        signal: Signal = (self._ringing @ self._modes).imag.astype(np.float32)
        self._ringing = self._ringing * self._modes[:, -1]
        self._rings = float(np.abs(self._ringing).max()) > UNHEARD
        return signal
