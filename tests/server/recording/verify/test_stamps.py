"""Stamps of pictures and sounds are judged by the feedback that began their event, also one that comes later."""

from lockstep.server.recording.format.records import FeedbackRecord
from lockstep.server.recording.verify.stamps import OVERTAKEN, StampChecks

SECOND = 1_000_000_000


def feedback(event: int, time: float, issue: int = 1) -> FeedbackRecord:
    return FeedbackRecord(epoch="e", event=event, issue=issue, time=time, axes=[0.0], joints=[])


def test_a_picture_of_before_its_event_is_wrong_and_one_of_its_event_is_not() -> None:
    checks = StampChecks()
    assert checks.feedback(feedback(1, 10.0), 10 * SECOND) == []
    assert checks.feedback(feedback(2, 11.0), 11 * SECOND) == []
    assert checks.medium("front", 2, 11 * SECOND, 11 * SECOND) == []
    (wrong,) = checks.medium("front", 2, 12 * SECOND, 10_900_000_000)
    assert (wrong.event, wrong.time) == (2, 12_000_000)
    assert wrong.text == "front: captured 100.0 ms before its event began"


def test_a_picture_that_overtakes_its_feedback_is_judged_when_that_comes() -> None:
    checks = StampChecks()
    checks.feedback(feedback(1, 10.0), 10 * SECOND)
    assert checks.medium("front", 2, 11 * SECOND, 10_500_000_000) == []
    assert checks.feedback(feedback(1, 10.6, issue=2), 10_600_000_000) == []
    (wrong,) = checks.feedback(feedback(2, 11.0), 11 * SECOND)
    assert wrong.text == "front: captured 500.0 ms before its event began"
    assert checks.end(99 * SECOND) == []


def test_a_stamp_that_no_feedback_has_is_wrong_unless_the_file_ends_right_behind_it() -> None:
    checks = StampChecks()
    checks.medium("ear", 7, 5 * SECOND, 5 * SECOND)
    assert checks.end(5_000_000 + OVERTAKEN) == []
    assert [each.text for each in checks.end(5_000_001 + OVERTAKEN)] == [
        "ear: stamped with an event that is not recorded"
    ]


def test_a_begin_that_was_not_seen_judges_nothing_and_what_is_no_event_is_wrong() -> None:
    checks = StampChecks()
    checks.feedback(feedback(5, 10.0, issue=3), 10 * SECOND)
    assert checks.medium("front", 5, 10 * SECOND, 9 * SECOND) == []
    assert [each.text for each in checks.medium("front", 0, 10 * SECOND, 9 * SECOND)] == ["front: 0 is not an event"]


def test_a_feedback_that_goes_back_begins_nothing() -> None:
    checks = StampChecks()
    checks.feedback(feedback(5, 10.0), 10 * SECOND)
    checks.feedback(feedback(4, 10.5), 10_500_000_000)
    assert checks.medium("front", 4, 10 * SECOND, 9 * SECOND) == []
