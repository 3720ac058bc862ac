from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.auth.invitation_clock import LinkClock

TIMES = st.floats(0, 4e9)


def test_it_is_the_wall_clock_as_a_rule() -> None:
    clock = LinkClock(0.0, 100.0)
    assert clock.at(1000.0, 101.0) == 1000.0
    assert clock.at(1001.5, 102.0) == 1001.5


def test_a_wall_clock_that_goes_back_does_not_take_it_back_and_time_goes_on() -> None:
    clock = LinkClock(0.0, 100.0)
    clock.at(1000.0, 100.0)
    assert clock.at(5.0, 103.0) == 1003.0


def test_the_newest_time_of_an_earlier_run_counts() -> None:
    clock = LinkClock(5000.0, 100.0)
    assert clock.at(0.0, 160.0) == 5060.0
    clock.saw(9000.0)
    assert clock.at(0.0, 160.0) == 9000.0
    clock.saw(1.0)
    assert clock.at(0.0, 161.0) == 9001.0


@given(TIMES, st.lists(st.tuples(TIMES, TIMES)))
def test_it_never_runs_backwards(seen: float, readings: list[tuple[float, float]]) -> None:
    clock, last = LinkClock(seen, 0.0), seen
    for wall, steady in readings:
        now = clock.at(wall, steady)
        assert now >= max(last, wall)
        last = now
