"""When a client asks for an answer that is due."""

import pytest

from lockstep.protocol.messages import Command, LinkMessage, Rest, Stop, StopTaken
from lockstep.protocol.pacing.repeat_timer import CAP, FLOOR, INITIAL
from lockstep.robot_bridge.link.asking import MOST_ASKS, Asking
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


def test_an_answer_that_was_asked_for_tells_nothing_of_how_long_answers_take() -> None:
    asking = learnt(0.002)
    asking.sent(command(60), 100.0)
    asking.asked(100.02)
    asking.received(feedback(60), 100.4)
    asking.sent(command(61), 101.0)
    assert asking.at == 101.0 + FLOOR


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
    asking.received(feedback(60), 1.05)
    assert asking.at == 1.01 + INITIAL
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
        asking.sent(Stop(press=PRESS), 1.06)
    assert asking.at == 1.06 + INITIAL


def test_a_command_after_the_serial_number_wrapped_is_answered_by_its_own_feedback() -> None:
    asking = Asking()
    asking.sent(command(1), 1.0)
    asking.received(feedback(2**31 - 1), 1.05)
    assert asking.at is not None
    asking.received(feedback(1), 1.06)
    assert asking.at is None
