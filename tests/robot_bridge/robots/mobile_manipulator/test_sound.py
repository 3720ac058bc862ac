import numpy as np
import numpy.typing as npt
import pytest

from lockstep.robot_bridge.robots.mobile_manipulator.hearing import Heard
from lockstep.robot_bridge.robots.mobile_manipulator.sound import Sound

RATE, SAMPLES = 48_000, 960
QUIET = Heard()
DRIVING = Heard(wheels=0.6)


def play(sound: Sound, *segments: Heard) -> npt.NDArray[np.float64]:
    return np.frombuffer(b"".join(sound.segment(heard) for heard in segments), "<i2").astype(float)


def level(samples: npt.NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(samples**2)))


def test_a_segment_has_two_bytes_per_sample() -> None:
    assert len(Sound(RATE, SAMPLES).segment(QUIET)) == 2 * SAMPLES


def test_at_rest_the_fan_is_soft_but_audible() -> None:
    assert 50 < level(play(Sound(RATE, SAMPLES), *[QUIET] * 50)) < 1000


@pytest.mark.parametrize(
    "heard", [DRIVING, Heard(arm=1.0), Heard(wrist=1.0), Heard(rubbing=5.0), Heard(knocks=100.0)], ids=str
)
def test_whatever_moves_or_touches_is_louder_than_rest(heard: Heard) -> None:
    quiet = level(play(Sound(RATE, SAMPLES), *[QUIET] * 20))
    assert level(play(Sound(RATE, SAMPLES), *[heard] * 20)) > 2 * quiet


def test_faster_is_higher() -> None:
    def pitch(speed: float) -> float:
        samples = play(Sound(RATE, SAMPLES), *[Heard(wheels=speed)] * 50)[RATE // 4 :]
        return float(np.fft.rfftfreq(len(samples), 1 / RATE)[np.argmax(np.abs(np.fft.rfft(samples)))])

    assert pitch(0.6) > pitch(0.3) > pitch(0.1)


@pytest.mark.parametrize("voice", Heard._fields)
@pytest.mark.parametrize("seed", range(3))
def test_segments_join_without_a_click_however_the_robot_moves(voice: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    full = {"wheels": 0.6, "arm": 1.5, "wrist": 2.5, "rubbing": 5.0, "knocks": 100.0}[voice]
    levels = full * random.choice((0.0, 1.0), 100) * random.uniform(0.3, 1.0, 100)
    samples = play(Sound(RATE, SAMPLES), *[QUIET._replace(**{voice: level}) for level in levels])
    step = np.abs(np.diff(samples))  # a click is a step larger than any inside a segment
    joins = step[SAMPLES - 1 :: SAMPLES]
    inside = np.delete(step, np.arange(SAMPLES - 1, len(step), SAMPLES))
    assert len(joins) == 99
    assert joins.max() <= 1.1 * inside.max()  # a knock is steepest where it begins, which is at a join


def test_the_loudest_of_everything_does_not_clip_hard() -> None:
    samples = play(Sound(RATE, SAMPLES), *[Heard(2.0, 9.0, 9.0, 500.0, 9000.0)] * 50)
    assert np.abs(samples).max() <= 32_000
