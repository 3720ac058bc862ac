from typing import Any

from lockstep.bench.soak.judge import Judge, Verdict


def _judged(*records: dict[str, Any]) -> Verdict:
    judge = Judge(max_event_age=2.0, hold=0.3)
    judge.read([{"kind": "start", "time": 0.0, "event": 1}, *records])
    return judge.verdict


def _feedback(event: int, time: float, at_rest: bool = True) -> dict[str, Any]:
    return {"kind": "feedback", "event": event, "issue": event, "time": time, "at_rest": at_rest}


def _executed(event: int, time: float, speed: float = 0.5) -> dict[str, Any]:
    return {"kind": "executed", "event": event, "issue": event - 1, "time": time, "values": [speed, 0.0]}


def _counts(verdict: Verdict) -> tuple[int, int, int, int]:
    return (
        verdict["executed_twice"],
        verdict["executed_late"],
        verdict["moved_without_seat"],
        verdict["moved_while_stopped"],
    )


def test_an_orderly_drive_has_nothing_to_count() -> None:
    verdict = _judged(_feedback(1, 0.1), _executed(2, 0.2), _feedback(2, 0.21, False), _executed(3, 0.3))
    assert _counts(verdict) == (0, 0, 0, 0)
    assert (verdict["executed"], verdict["epochs"]) == (2, 1)


def test_the_same_event_executed_again_is_counted() -> None:
    assert _counts(_judged(_feedback(1, 0.1), _executed(2, 0.2), _executed(2, 0.3))) == (1, 0, 0, 0)


def test_the_same_number_in_another_epoch_is_another_event() -> None:
    again = {"kind": "start", "time": 5.0, "event": 1}
    verdict = _judged(_feedback(1, 0.1), _executed(2, 0.2), again, _feedback(1, 5.1), _executed(2, 5.2))
    assert _counts(verdict) == (0, 0, 0, 0)


def test_an_answer_to_a_feedback_of_three_seconds_ago_is_late() -> None:
    assert _counts(_judged(_feedback(1, 0.1), _executed(2, 3.1))) == (0, 1, 0, 0)


def test_an_answer_to_a_feedback_that_was_never_issued_counts_as_late() -> None:
    assert _counts(_judged(_executed(2, 0.2))) == (0, 1, 0, 0)


def test_driving_backwards_is_the_mark_of_those_without_the_seat() -> None:
    assert _counts(_judged(_feedback(1, 0.1), _executed(2, 0.2, -0.5))) == (0, 0, 1, 0)


def test_a_command_executed_between_stop_and_reset_is_counted() -> None:
    stop = {"kind": "stop", "time": 0.15, "event": 1}
    reset = {"kind": "reset", "time": 0.5, "event": 1}
    assert _counts(_judged(_feedback(1, 0.1), stop, _executed(2, 0.2), reset)) == (0, 0, 0, 1)
    assert _counts(_judged(_feedback(1, 0.4), stop, reset, _executed(2, 0.6))) == (0, 0, 0, 0)


def test_a_stopped_robot_that_still_moves_after_hold_is_counted() -> None:
    stop = {"kind": "stop", "time": 1.0, "event": 1}
    assert _counts(_judged(stop, _feedback(1, 1.2, False), _feedback(1, 1.5, True))) == (0, 0, 0, 0)
    assert _counts(_judged(stop, _feedback(1, 1.5, False))) == (0, 0, 0, 1)
