"""What held when."""

from lockstep.robot_bridge.control.event_times import HISTORY, EventTimes
from lockstep.robot_bridge.robots.base import Stamp


def test_an_event_holds_from_the_time_it_became_current_until_the_next() -> None:
    times = EventTimes()
    times.changed(1, 10.0)
    times.changed(2, 11.0)
    assert times.at(10.0) == Stamp(1, 10.0)
    assert times.at(10.999) == Stamp(1, 10.999)
    assert times.at(11.0) == Stamp(2, 11.0)
    assert times.at(99.0) == Stamp(2, 99.0)


def test_an_event_measured_again_holds_since_it_was_first_issued() -> None:
    times = EventTimes()
    times.changed(1, 10.0)
    times.changed(1, 12.0)
    assert times.at(10.5) == Stamp(1, 10.5)


def test_before_what_is_remembered_nothing_is_known() -> None:
    times = EventTimes()
    assert times.at(1.0) is None
    for number in range(HISTORY + 1):
        times.changed(number + 1, float(number))
    assert times.at(0.5) is None
    assert times.at(1.5) == Stamp(2, 1.5)


def test_an_event_began_when_it_became_current_and_is_forgotten_with_the_history() -> None:
    times = EventTimes()
    times.changed(1, 10.0)
    times.changed(2, 11.0)
    assert (times.began(1), times.began(2), times.began(3)) == (10.0, 11.0, None)
    for event in range(3, 3 + HISTORY):
        times.changed(event, float(event))
    assert times.began(2) is None
