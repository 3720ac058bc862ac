import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.server.media.quality.frame_decimator import FrameDecimator


def taken(wanted: float, source: float, seconds: float, jitter: list[float] | None = None) -> list[float]:
    cadence = FrameDecimator()
    times = [i / source + (jitter[i % len(jitter)] if jitter else 0) for i in range(int(seconds * source))]
    return [time for time in times if cadence.take(time, wanted, source)]


@pytest.mark.parametrize(
    ("wanted", "count"), [(30.0, 300), (15.0, 150), (10.0, 100), (7.5, 75), (5.0, 50), (60.0, 300)]
)
def test_pictures_come_at_the_wanted_rate(wanted: float, count: int) -> None:
    assert len(taken(wanted, 30.0, 10.0)) == pytest.approx(count, abs=1)


@settings(deadline=None)
@given(st.lists(st.floats(-0.01, 0.01), min_size=1, max_size=7))
def test_a_camera_that_jitters_is_thinned_all_the_same(jitter: list[float]) -> None:
    assert len(taken(10.0, 30.0, 10.0, jitter)) == pytest.approx(100, abs=2)


def test_after_a_pause_there_is_no_burst() -> None:
    cadence = FrameDecimator()
    cadence.take(0.0, 10.0, 30.0)
    assert [cadence.take(5 + i / 30, 10.0, 30.0) for i in range(4)] == [True, False, False, True]
