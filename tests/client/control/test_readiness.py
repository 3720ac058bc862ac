import pytest

from lockstep.client.control.readiness import Readiness
from lockstep.protocol.messages import StopState
from tests.makers import feedback


def _armed() -> Readiness:
    readiness = Readiness()
    readiness.begin()
    assert readiness.answered(feedback(2), neutral=True) is None
    assert (readiness.ready, readiness.arming) == (True, False)
    return readiness


def test_only_the_answer_to_a_neutral_command_that_is_wanted_makes_it_ready() -> None:
    readiness = Readiness()
    readiness.answered(feedback(2), neutral=True)
    assert not readiness.ready
    readiness.begin()
    readiness.answered(feedback(3), neutral=False)
    assert not readiness.ready
    readiness.answered(feedback(4, stopped=True), neutral=True)
    assert not readiness.ready
    readiness.answered(feedback(5), neutral=True)
    assert readiness.ready


def test_a_neutral_command_without_effect_is_followed_by_one_more_and_no_third() -> None:
    readiness = Readiness()
    readiness.begin()
    assert readiness.answered(feedback(2, neutral_needed=True), neutral=True) == "again"
    assert readiness.answered(feedback(3, neutral_needed=True), neutral=True) == "failed"
    assert not readiness.arming


@pytest.mark.parametrize(
    ("stop", "why"),
    [(StopState(), None), (StopState(number=1), "stopped"), (StopState(stopped=True, number=1), "stopped")],
)
def test_a_stop_ends_it_also_when_it_is_reset_already(stop: StopState, why: str | None) -> None:
    readiness = _armed()
    readiness.lost_by(feedback(2), wanted=False)
    assert readiness.lost_by(feedback(2, 2, stop=stop), wanted=False) == why


def test_a_stop_is_news_as_long_as_something_is_wanted() -> None:
    readiness = Readiness()
    assert readiness.lost_by(feedback(1, stopped=True), wanted=False) is None
    assert readiness.lost_by(feedback(1, 2, stopped=True), wanted=True) == "stopped"


def test_a_robot_that_asks_for_a_neutral_command_ends_it() -> None:
    readiness = _armed()
    assert readiness.lost_by(feedback(2, neutral_needed=True), wanted=False) == "not_neutral"
    readiness.lose()
    assert readiness.lost_by(feedback(2, 2, neutral_needed=True), wanted=True) is None


def test_an_arming_that_is_given_up_leaves_a_ready_robot_ready() -> None:
    readiness = _armed()
    readiness.begin()
    readiness.give_up_arming()
    assert (readiness.ready, readiness.arming) == (True, False)


def test_the_answer_to_a_neutral_command_whose_arming_was_given_up_makes_nothing_ready() -> None:
    readiness = Readiness()
    readiness.begin()
    readiness.give_up_arming()
    assert readiness.answered(feedback(2), neutral=True) is None
    assert not readiness.ready


def test_a_robot_that_is_unready_becomes_ready_by_the_neutral_command_that_stays_wanted() -> None:
    readiness = _armed()
    readiness.begin()
    readiness.unready()
    assert (readiness.ready, readiness.arming) == (False, True)
    assert readiness.answered(feedback(3), neutral=True) is None
    assert (readiness.ready, readiness.arming) == (True, False)
