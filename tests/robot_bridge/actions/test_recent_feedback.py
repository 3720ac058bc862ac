"""Which feedbacks a request for an action may answer."""

import pytest

from lockstep.robot_bridge.actions.recent_feedback import MAX_NONCES, RecentFeedback

AGE = 2.0


@pytest.mark.parametrize("moves", [False, True])
def test_a_feedback_is_answered_in_time_up_to_its_age(moves: bool) -> None:
    feedback = RecentFeedback(AGE)
    feedback.issued(5, 10.0)
    assert feedback.is_answered_in_time(5, 10.0 + AGE, moves=moves)
    assert not feedback.is_answered_in_time(5, 10.1 + AGE, moves=moves)
    assert not feedback.is_answered_in_time(6, 10.0, moves=moves)


def test_a_cause_that_voids_concerns_motions_from_before_it_alone() -> None:
    feedback = RecentFeedback(AGE)
    feedback.issued(5, 10.0)
    feedback.void()
    feedback.issued(6, 10.1)
    assert not feedback.is_answered_in_time(5, 10.2, moves=True)
    assert feedback.is_answered_in_time(5, 10.2, moves=False)
    assert feedback.is_answered_in_time(6, 10.2, moves=True)


def test_what_is_forgotten_is_late() -> None:
    feedback = RecentFeedback(AGE)
    feedback.issued(5, 10.0)
    feedback.forget()
    assert not feedback.is_answered_in_time(5, 10.0, moves=False)


def test_of_too_many_the_oldest_is_forgotten() -> None:
    feedback = RecentFeedback(AGE)
    for nonce in range(MAX_NONCES + 1):
        feedback.issued(nonce, 10.0)
    assert not feedback.is_answered_in_time(0, 10.0, moves=False)
    assert feedback.is_answered_in_time(1, 10.0, moves=False)
