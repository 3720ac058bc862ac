import pytest

from lockstep.server.media.quality.loop_load import LoopLoad


def test_the_load_is_measured_once_a_second_from_the_last_measurement_on() -> None:
    busy = [5.0]
    load = LoopLoad(lambda: busy[0], 10.0)
    busy[0] = 5.5
    assert load.measure(10.9) is None
    assert load.measure(11.0) == pytest.approx(0.5)
    busy[0] = 5.7
    assert load.measure(11.5) is None
    assert load.measure(13.0) == pytest.approx(0.1)
