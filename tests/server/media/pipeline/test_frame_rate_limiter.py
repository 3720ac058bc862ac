import pytest

from lockstep.server.media.pipeline.frame_rate_limiter import FrameRateLimiter


def admitted(pace: FrameRateLimiter, times: list[float]) -> list[float]:
    return [time for time in times if pace.admit(time)]


@pytest.mark.parametrize(("rate", "expected"), [(8.0, 80), (16.0, 160), (30.0, 300), (60.0, 300)])
def test_a_camera_of_30_pictures_a_second_is_thinned_to_the_rate_on_average(rate: float, expected: int) -> None:
    count = len(admitted(FrameRateLimiter(rate), [number / 30 for number in range(300)]))
    assert abs(count - expected) <= 2


def test_without_a_rate_every_picture_passes() -> None:
    times = [0.0, 0.001, 0.002]
    assert admitted(FrameRateLimiter(None), times) == times


def test_after_a_pause_nothing_is_made_up_for() -> None:
    pace = FrameRateLimiter(10)
    assert admitted(pace, [0.0, 5.0, 5.02, 5.04, 5.1]) == [0.0, 5.0, 5.1]


def test_a_clock_that_begins_anew_is_followed() -> None:
    pace = FrameRateLimiter(10)
    assert admitted(pace, [1000.0, 1.0, 1.05, 1.1]) == [1000.0, 1.0, 1.1]
