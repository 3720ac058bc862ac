from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.serial import FIRST_EVENT, MAX_EVENT, event_gap
from lockstep.server.event_clock import HISTORY, EventClock
from tests.makers import feedback


def test_before_the_first_feedback_nothing_is_known() -> None:
    clock = EventClock()
    assert clock.event == FIRST_EVENT
    assert not clock.stop.stopped
    assert clock.reference_at(1.0) is None


def test_another_epoch_starts_anew_and_the_same_goes_on() -> None:
    clock = EventClock()
    assert clock.begin("a")
    clock.observe(feedback(7, stopped=True), 1.0)
    assert not clock.begin("a")
    assert clock.event == 7
    assert clock.stop.stopped
    assert clock.begin("b")
    assert clock.feedback is None
    assert clock.reference_at(2.0) is None


def test_the_same_event_measured_again_is_news_once() -> None:
    clock = EventClock()
    assert clock.observe(feedback(7, 1), 0.0)
    assert clock.observe(feedback(7, 2), 0.0)
    assert not clock.observe(feedback(7, 2), 0.0)
    assert not clock.observe(feedback(7, 1), 0.0)


@given(st.integers(1, MAX_EVENT), st.lists(st.tuples(st.integers(-3, 3), st.integers(1, 5))))
def test_the_reference_never_goes_back(start: int, steps: list[tuple[int, int]]) -> None:
    clock, last = EventClock(), start
    clock.observe(feedback(start), 0.0)
    for now, (step, issue) in enumerate(steps):
        clock.observe(feedback((last + step - 1) % MAX_EVENT + 1, issue), float(now))
        assert event_gap(clock.event, last) >= 0
        last = clock.event


def test_a_medium_is_stamped_with_what_held_then() -> None:
    clock = EventClock()
    clock.observe(feedback(5), 1.0)
    clock.observe(feedback(5, 2), 1.5)
    clock.observe(feedback(6), 2.0)
    assert clock.reference_at(0.9) is None
    assert clock.reference_at(1.0) == 5
    assert clock.reference_at(1.99) == 5
    assert clock.reference_at(2.0) == 6


def test_only_so_much_history_is_kept() -> None:
    clock = EventClock()
    for event in range(1, HISTORY + 2):
        clock.observe(feedback(event), float(event))
    assert clock.reference_at(1.5) is None
    assert clock.reference_at(2.5) == 2


def test_the_robot_is_driven_for_a_second_after_each_event() -> None:
    clock = EventClock()
    assert not clock.is_driven(0.0)
    clock.observe(feedback(7, 1), 10.0)
    clock.observe(feedback(7, 2), 10.8)  # the same event, measured again
    assert clock.is_driven(10.9)
    assert not clock.is_driven(11.1)
