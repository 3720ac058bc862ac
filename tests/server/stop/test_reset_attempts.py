import pytest

from lockstep.protocol.messages import Refusal, RefusalReason, StopState
from lockstep.server.stop.reset_attempts import PATIENCE, ResetAttempts, ResetOutcome


def _attempts(number: int = 5) -> ResetAttempts[str]:
    attempts: ResetAttempts[str] = ResetAttempts()
    assert attempts.ask(number, "Ann", 0.0)
    return attempts


def test_a_reset_had_effect_when_a_feedback_says_not_stopped_under_its_number() -> None:
    attempts = _attempts()
    assert attempts.feedback(StopState(stopped=True, number=5)) == []
    assert attempts.feedback(StopState(stopped=False, number=4)) == []
    assert attempts.feedback(StopState(stopped=False, number=5)) == [ResetOutcome("Ann", 5, None)]
    assert len(attempts) == 0


@pytest.mark.parametrize("stopped", [True, False])
def test_a_newer_stop_makes_it_stale(stopped: bool) -> None:
    (outcome,) = _attempts().feedback(StopState(stopped=stopped, number=6))
    assert outcome.reason == "stale_reset"


@pytest.mark.parametrize("reason", ["stale_reset", "too_soon", "locked_out"])
def test_the_bridges_refusal_is_its_outcome(reason: RefusalReason) -> None:
    attempts = _attempts()
    assert attempts.refused(Refusal(event=0, reason=reason, current=1, stop=4)) == []
    assert attempts.refused(Refusal(event=0, reason="malformed", current=1, stop=0)) == []
    assert attempts.refused(Refusal(event=7, reason="stopped", current=1)) == []
    refusal = Refusal(event=0, reason=reason, current=1, stop=5, detail="why")
    assert attempts.refused(refusal) == [ResetOutcome("Ann", 5, reason, "why")]


def test_two_who_ask_for_the_same_are_one_attempt_with_one_outcome() -> None:
    attempts = _attempts()
    assert not attempts.ask(5, "Bob", 0.5)
    assert [each.asker for each in attempts.feedback(StopState(number=5))] == ["Ann", "Bob"]


def test_without_an_answer_in_time_and_without_a_link_nobody_knows() -> None:
    attempts = _attempts()
    assert attempts.expire(PATIENCE / 2) == []
    assert [each.reason for each in attempts.expire(PATIENCE)] == ["link_down"]
    assert attempts.ask(5, "Ann", 3.0)
    assert [each.reason for each in attempts.robot_link_down("gone")] == ["link_down"]
    assert len(attempts) == 0
