import pytest

from lockstep.client.control.command_sender import Outcome
from lockstep.client.control.waiters import Waiters
from lockstep.client.errors import CommandRefused, ConsoleLost, NotArmed
from tests.makers import feedback, refusal


async def test_an_outcome_is_that_of_all_intentions_up_to_its_own() -> None:
    waiters = Waiters()
    first, second, third = (waiters.answer(ticket) for ticket in (1, 2, 3))
    waiters.settle([Outcome(2, feedback(7), None)])
    assert [first.result().event, second.result().event, third.done()] == [7, 7, False]


async def test_a_refusal_is_raised_and_that_for_want_of_a_neutral_command_by_name() -> None:
    waiters = Waiters()
    first, second = waiters.answer(1), waiters.answer(2)
    waiters.settle([Outcome(1, None, refusal(2, "stopped")), Outcome(2, None, refusal(2, "not_neutral"))])
    with pytest.raises(CommandRefused, match="stopped"):
        await first
    with pytest.raises(NotArmed):
        await second


async def test_those_who_wait_no_longer_are_passed_over() -> None:
    waiters = Waiters()
    answer, rest = waiters.answer(1), waiters.rest()
    answer.cancel()
    rest.cancel()
    waiters.settle([Outcome(1, feedback(1), None)])
    waiters.rested()
    waiters.end(ConsoleLost("over"))


async def test_the_end_of_the_connection_is_told_to_all_and_known_from_then_on() -> None:
    waiters = Waiters()
    waiters.check()
    answer, rest = waiters.answer(1), waiters.rest()
    waiters.end(ConsoleLost("gone"))
    for each in (answer, rest):
        with pytest.raises(ConsoleLost, match="gone"):
            await each
    with pytest.raises(ConsoleLost, match="gone"):
        waiters.check()
