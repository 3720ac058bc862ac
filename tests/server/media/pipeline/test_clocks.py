import pytest

from lockstep.server.media.pipeline.capture_clock import WINDOW_SECONDS, CaptureClock
from lockstep.server.media.pipeline.media_clock import PictureClock, SoundClock

UNIX = 1_790_000_000.0


def test_the_capture_time_is_right_but_for_the_shortest_transport_time() -> None:
    clock = CaptureClock()
    for link_time, delay in [(10.0, 0.030), (10.1, 0.002), (10.2, 0.500)]:
        clock.observe(link_time, UNIX + link_time + delay)
    assert clock.wall_time(10.2) == pytest.approx(UNIX + 10.2 + 0.002, abs=1e-6)


def test_clocks_that_drift_apart_are_followed() -> None:
    clock = CaptureClock()
    drift = 1e-3
    for i in range(1000):
        link_time = float(i)
        clock.observe(link_time, UNIX + link_time * (1 + drift))
        late = UNIX + link_time * (1 + drift) - clock.wall_time(link_time)
        assert 0 <= late <= 2 * WINDOW_SECONDS * drift + 1e-6


def test_picture_timestamps_follow_the_link_in_90_khz_and_strictly_increase() -> None:
    clock = PictureClock()
    times = [5.0, 5.0 + 1 / 30, 5.0 + 1 / 30, 5.0, 6.0]
    assert [clock.timestamp(time) for time in times] == [0, 3000, 3001, 3002, 90000]


def test_sound_stays_sample_exact_under_jitter() -> None:
    clock = SoundClock(16_000)
    jitter = [0.0, 0.01, -0.01, 0.02, 0.0]
    placed = [clock.place(3.0 + i * 0.02 + late, 320) for i, late in enumerate(jitter)]
    assert placed == [(i * 320, True) for i in range(5)]


def test_sound_moves_on_where_some_is_missing_and_never_back() -> None:
    clock = SoundClock(16_000)
    clock.place(3.0, 320)
    assert clock.place(4.0, 320) == (16_000, False)
    assert clock.place(4.02, 320) == (16_320, True)
    assert clock.place(3.5, 320) == (16_640, True)


@pytest.mark.parametrize(("error", "breaks"), [(1.001, 0), (0.999, 3)])
def test_a_sound_card_that_is_too_fast_or_too_slow_breaks_the_sound_hardly_ever(error: float, breaks: int) -> None:
    clock = SoundClock(16_000)
    placed = [clock.place(i * 0.02 / error, 320) for i in range(50 * 130)]  # 130 s
    assert sum(not continuous for _, continuous in placed) == breaks
    assert all(later[0] - earlier[0] >= 320 for earlier, later in zip(placed, placed[1:], strict=False))
