import random

import pytest

from lockstep.bench.figures.media_join import join_pictures

CLOCK_RATE = 90_000


def captures(count: int, seed: int = 1) -> list[float]:
    """About 30 a second, as uneven as a real camera."""
    jitter = random.Random(seed)
    return [1000.0 + number / 30 + jitter.random() * 0.003 for number in range(count)]


def timestamps(times: list[float], start: int) -> list[int]:
    """As a sender that counts from its first picture on, with a random start."""
    return [(start + round((time - 1000.0) * CLOCK_RATE)) % 2**32 for time in times]


def test_every_shown_picture_finds_its_capture() -> None:
    times = captures(300)
    shown = times[50:250]
    joined = join_pictures(timestamps(shown, 123_456), times)
    assert joined.captured == shown
    assert joined.matched == 200


def test_pictures_that_were_never_shown_do_not_shift_the_others() -> None:
    times = captures(300)
    shown = [time for number, time in enumerate(times) if number % 3 and number > 100]
    assert join_pictures(timestamps(shown, 5), times).captured == shown


def test_timestamps_may_wrap() -> None:
    times = captures(300)
    assert join_pictures(timestamps(times, 2**32 - 100_000), times).captured == times


def test_a_picture_that_was_not_captured_is_left_out() -> None:
    times = captures(100)
    shown = [*times[:50], times[50] + 0.01, *times[51:]]
    joined = join_pictures(timestamps(shown, 7), times)
    assert joined.captured[50] is None
    assert joined.matched == 99


def test_pictures_of_another_camera_are_refused() -> None:
    with pytest.raises(ValueError, match="fit the captured"):
        join_pictures(timestamps(captures(200, seed=2), 7), captures(200, seed=3))


def test_nothing_shown_is_refused() -> None:
    with pytest.raises(ValueError, match="nothing"):
        join_pictures([], captures(3))
