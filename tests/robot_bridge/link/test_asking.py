"""When a client asks for an answer that is due."""

import pytest

from lockstep.protocol.messages import Command, LinkMessage, Rest, Stop, StopTaken
from lockstep.protocol.pacing.repeat_timer import CAP, FLOOR, INITIAL
from lockstep.robot_bridge.link.asking import EXPECTED_FOR, MOST_ASKS, PROBE, Asking
from tests.makers import feedback, refusal

PRESS = "0" * 32


def command(event: int) -> Command:
    return Command(event=event, issue=1, nonce=0, values=[0.0])


def learnt(trip: float, times: int = 50) -> Asking:
    """One that has seen answers after `trip` s, from event 2 on."""
    asking = Asking()
    for event in range(2, 2 + times):
        asking.sent(command(event), float(event))
        asking.received(feedback(event), event + trip)
    return asking


def test_an_answer_is_asked_for_a_little_after_the_time_that_answers_take() -> None:
    assert Asking().at is None
    first = Asking()
    first.sent(command(2), 1.0)
    assert first.at == 1.0 + INITIAL
    asking = learnt(0.1)
    asking.sent(command(60), 100.0)
    assert asking.at == pytest.approx(100.1, abs=0.02)
    near = learnt(0.002)
    near.sent(command(60), 100.0)
    assert near.at == 100.0 + FLOOR


def test_it_asks_twice_at_the_interval_then_more_and_more_seldom_and_at_last_no_more() -> None:
    asking = learnt(0.002)
    asking.sent(command(60), 100.0)
    waits, now = [], 100.0
    while asking.at is not None:
        waits.append(asking.at - now)
        now = asking.at
        asking.asked(now)
    assert waits == pytest.approx([FLOOR, FLOOR, *(min(CAP, FLOOR * 2**n) for n in range(1, MOST_ASKS - 1))])


def test_a_late_answer_lengthens_the_time_a_little_and_a_longer_path_is_learnt() -> None:
    asking = learnt(0.002)
    asking.sent(command(60), 100.0)
    asking.asked(100.0 + FLOOR)
    asking.received(feedback(60), 130.0)  # a loss
    asking.sent(command(61), 200.0)
    assert asking.at is not None
    assert FLOOR < asking.at - 200.0 < 0.1
    for event in range(62, 82):
        asking.received(feedback(event - 1), 100.0 * event + 0.3)  # the path is longer now
        asking.sent(command(event), 100.0 * (event + 1))
    assert asking.at == pytest.approx(100.0 * 82 + 0.3, abs=0.2)


def test_a_stop_between_a_command_and_its_feedback_tells_nothing_of_how_long_answers_take() -> None:
    asking = learnt(0.1)
    asking.sent(command(60), 100.0)
    asking.sent(Stop(press=PRESS), 100.09)
    asking.received(StopTaken(press=PRESS, number=1), 100.095)
    asking.received(feedback(60), 100.1)
    asking.sent(command(61), 101.0)
    assert asking.at == pytest.approx(101.1, abs=0.02)


def test_a_path_that_is_longer_than_it_ever_waits_has_no_ping_behind_each_command() -> None:
    asking = Asking()
    for event in range(2, 60):
        asking.sent(command(event), 10.0 * event)
        while asking.at is not None and asking.at < 10.0 * event + 0.6:
            asking.asked(asking.at)
        asking.received(feedback(event), 10.0 * event + 0.6)
    asking.sent(command(60), 600.0)
    assert asking.at == 600.0 + CAP


def test_after_a_late_answer_a_ping_follows_each_command_at_once_for_some_time() -> None:
    asking = learnt(0.1)
    asking.sent(command(60), 100.0)
    late = asking.at
    assert late is not None
    asking.asked(late)
    asking.received(feedback(60), late + 0.1)
    asking.sent(command(61), late + 1.0)
    assert asking.at == late + 1.0 + PROBE
    asking.asked(late + 1.0 + PROBE)
    assert asking.at > late + 1.1, "and again when its answer is late"
    asking.received(feedback(61), late + 1.1)
    asking.sent(command(62), late + EXPECTED_FOR + 0.001)
    assert asking.at > late + EXPECTED_FOR + 0.05


def test_a_ping_at_once_does_not_prolong_the_time_of_pings_at_once() -> None:
    asking = learnt(0.002)
    asking.sent(command(60), 100.0)
    asking.asked(100.0 + FLOOR)
    asking.received(feedback(60), 100.05)
    for event in range(61, 161):
        now = 100.0 + 0.1 * (event - 60)
        asking.sent(command(event), now)
        asking.asked(now + PROBE)
        asking.received(feedback(event), now + 0.007)
    asking.sent(command(161), 111.0)
    assert asking.at is not None
    assert asking.at >= 111.0 + FLOOR


@pytest.mark.parametrize("message", [feedback(60), feedback(61), refusal(60, "late")])
def test_the_feedback_of_the_command_a_later_one_and_a_refusal_are_answers(message: LinkMessage) -> None:
    asking = Asking()
    asking.sent(command(60), 1.0)
    asking.received(message, 1.05)
    assert asking.at is None


@pytest.mark.parametrize("message", [feedback(59), refusal(59, "late"), StopTaken(press=PRESS, number=1)])
def test_other_messages_are_no_answers(message: LinkMessage) -> None:
    asking = Asking()
    asking.sent(command(60), 1.0)
    asking.received(message, 1.05)
    assert asking.at == 1.0 + INITIAL


def test_a_stop_is_asked_for_by_its_press_whatever_commands_are_answered() -> None:
    asking = Asking()
    asking.sent(command(60), 1.0)
    asking.sent(Stop(press=PRESS), 1.01)
    assert asking.at == 1.01 + PROBE
    asking.received(feedback(60), 1.05)
    assert asking.at is not None
    asking.received(StopTaken(press="1" * 32, number=1), 1.06)
    assert asking.at is not None
    asking.received(StopTaken(press=PRESS, number=2), 1.07)
    assert asking.at is None


def test_a_copy_does_not_begin_anew_and_what_has_no_answer_of_its_own_is_not_waited_for() -> None:
    asking = Asking()
    for message in (Rest(event=5), Stop()):
        asking.sent(message, 1.0)
        assert asking.at is None
    for now in (1.0, 1.05):
        asking.sent(command(60), now)
    assert asking.at == 1.0 + INITIAL
    for now in (1.06, 1.07):
        asking.sent(Stop(press=PRESS), now)
    assert asking.at == 1.06 + PROBE


def test_a_command_after_the_serial_number_wrapped_is_answered_by_its_own_feedback() -> None:
    asking = Asking()
    asking.sent(command(1), 1.0)
    asking.received(feedback(2**31 - 1), 1.05)
    assert asking.at is not None
    asking.received(feedback(1), 1.06)
    assert asking.at is None
