import pytest

from lockstep.robot_bridge.control.issue_schedule import BURST, REFRESH_INTERVAL, IssueSchedule


def test_the_first_issue_is_due_at_once_and_a_further_one_at_the_refresh_interval() -> None:
    schedule = IssueSchedule()
    assert schedule.due(5.0)
    schedule.issued(5.0, answers=False)
    assert not schedule.due(5.0 + 0.99 * REFRESH_INTERVAL)
    assert schedule.due(5.0 + REFRESH_INTERVAL)


def test_a_change_makes_one_issue_due() -> None:
    schedule = IssueSchedule()
    schedule.issued(5.0, answers=False)
    schedule.want()
    assert schedule.due(5.0)
    schedule.issued(5.0, answers=False)
    assert not schedule.due(5.0)


def test_answers_keep_the_event_rate_after_a_burst() -> None:
    schedule = IssueSchedule(max_event_rate=8.0)
    for _ in range(BURST + 1):
        assert schedule.answer_due(5.0)
        schedule.issued(5.0, answers=True)
    assert not schedule.answer_due(5.0625)
    assert schedule.answer_due(5.125)


@pytest.mark.parametrize("wait", [0.25, 60.0])
def test_a_pause_earns_no_longer_burst(wait: float) -> None:
    schedule = IssueSchedule(max_event_rate=8.0)
    schedule.issued(5.0, answers=True)
    answered = 0
    while schedule.answer_due(5.0 + wait):
        schedule.issued(5.0 + wait, answers=True)
        answered += 1
    assert answered == BURST + 1
