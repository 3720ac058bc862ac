from typing import Any

from lockstep.bench.experiment.judge.outage_judge import Cut, Finding, judge_outage

CUT = Cut(10.0, 20.0, held=False)


def feedback(time: float, event: int, issue: int = 1) -> dict[str, Any]:
    return {"kind": "feedback", "time": time, "event": event, "issue": issue}


def executed(time: float, event: int, value: float = 0.4, issue: int = 1) -> dict[str, Any]:
    return {"kind": "executed", "time": time, "event": event, "issue": issue, "values": [value, 0.0]}


def at_rest(time: float) -> dict[str, Any]:
    return {"kind": "at_rest", "time": time, "event": 1}


def judged(*log: dict[str, Any], intentions: list[tuple[float, float]] | None = None) -> Finding:
    return judge_outage(log, CUT, hold=0.3, max_event_age=2.0, intentions=intentions or [])


GOOD = [
    *(feedback(9.8, 5), executed(9.9, 6), feedback(9.91, 6), executed(10.05, 7), feedback(10.06, 7)),
    *(at_rest(10.34), feedback(20.4, 7, issue=30), executed(20.6, 8, 0.5, issue=30)),
]


def test_a_robot_that_rested_in_time_and_moved_again_passes() -> None:
    found = judged(*GOOD, intentions=[(20.55, 0.5)])
    assert round(found.rest_seconds or 0, 3) == 0.29
    assert found.rested_within_hold
    assert found.nothing_queued_executed
    assert round(found.control_seconds or 0, 3) == 0.6
    assert round(found.oldest_intention or 0, 3) == 0.05


def test_a_robot_that_rested_late_fails() -> None:
    assert not judged(executed(9.9, 6), at_rest(10.3)).rested_within_hold


def test_a_robot_that_never_rested_fails() -> None:
    assert not judged(executed(9.9, 6)).rested_within_hold


def test_a_command_that_answers_a_feedback_of_before_fails() -> None:
    assert not judged(*GOOD[:6], executed(20.1, 8)).nothing_queued_executed


def test_a_command_that_answers_nothing_fails() -> None:
    assert not judged(*GOOD, executed(21.0, 9, issue=77)).nothing_queued_executed


def test_an_intention_of_before_the_outage_fails_even_as_the_answer_to_a_fresh_feedback() -> None:
    assert not judged(*GOOD, intentions=[(9.0, 0.5)]).nothing_queued_executed


def test_control_has_not_returned_before_something_moves() -> None:
    log = [*GOOD[:-1], executed(20.6, 8, 0.0, issue=30)]
    assert judged(*log).control_seconds is None
