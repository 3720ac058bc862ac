import random

import pytest

from lockstep.robot_bridge.control.ticks.ticker import Ticker


def test_beats_do_not_drift_when_each_wait_ends_late() -> None:
    metronome = Ticker(0.01, 0.0)
    now, waits = 0.0, []
    for _ in range(5):
        wait = metronome.wait(now)
        waits.append(wait)
        now += wait + 0.002
    assert waits == pytest.approx([0.01, 0.008, 0.008, 0.008, 0.008])


def test_missed_beats_within_the_catch_up_are_made_good_at_once() -> None:
    metronome = Ticker(0.01, 0.0, catch_up=3)
    assert [metronome.wait(0.035) for _ in range(4)] == pytest.approx([0.0, 0.0, 0.0, 0.005])
    assert metronome.skipped == 0


def test_more_missed_beats_are_skipped_and_counted() -> None:
    metronome = Ticker(0.01, 0.0, catch_up=3)
    waits = [metronome.wait(1.0001) for _ in range(6)]
    assert waits[:4] == [0.0, 0.0, 0.0, 0.0]
    assert waits[4] == pytest.approx(0.0099)
    assert metronome.skipped == 96


def test_without_catch_up_the_beat_that_is_due_comes_at_once_and_the_grid_stays() -> None:
    metronome = Ticker(0.01, 0.0)
    assert metronome.wait(0.057) == 0.0
    assert metronome.wait(0.057) == pytest.approx(0.003)


def test_beats_that_come_as_early_as_they_may_are_no_more_than_one_in_each_period() -> None:
    metronome, now, beats = Ticker(0.01, 0.0), 0.0, list[float]()
    chance = random.Random(1)
    for _ in range(1000):
        metronome.wait(now)
        soonest = metronome.early(now)
        beat = now + soonest if chance.random() < 0.7 else now + soonest + chance.random() * 0.01
        beats.append(beat)
        now = beat
    assert all(number * 0.01 <= beat + 1e-9 <= (number + 1) * 0.01 + 2e-9 for number, beat in enumerate(beats))


def test_a_beat_may_come_early_as_soon_as_its_period_has_begun() -> None:
    metronome = Ticker(0.01, 0.0)
    assert metronome.wait(0.0) == pytest.approx(0.01)
    assert metronome.early(0.0) == 0.0
    assert metronome.wait(0.002) == pytest.approx(0.018), "the beat before came at 0.002"
    assert metronome.early(0.002) == pytest.approx(0.008)
    assert metronome.early(0.015) == 0.0


def test_it_says_how_long_it_is_until_the_beat_after_this_one_and_until_that_may_come() -> None:
    metronome = Ticker(0.01, 0.0)
    metronome.wait(0.0)  # due at 0.01, and may come from 0
    assert metronome.left(0.002) == pytest.approx(0.018)
    assert metronome.until_early(0.002) == pytest.approx(0.008), "it came early"
    assert metronome.left(0.011) == pytest.approx(0.009)
    assert metronome.until_early(0.011) == 0.0
    assert metronome.left(0.025) == pytest.approx(-0.005)
