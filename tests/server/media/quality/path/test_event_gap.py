from lockstep.server.media.quality.path.event_gap import REST, EventGap


def reported(*gaps: int) -> EventGap:
    gap = EventGap()
    for each in gaps:
        gap.report(each, 4)
    return gap


def test_a_gap_is_near_after_two_reports_close_to_the_tolerance_that_were_not_always_so() -> None:
    assert not reported(1, 3).is_near(0.0)
    assert reported(1, 3, 3).is_near(0.0)
    assert not reported(1, 3, 2, 3).is_near(0.0)
    assert not reported(3, 3, 3).is_near(0.0), "it was never smaller"
    without_tolerance = EventGap()
    for each in (1, 3, 3):
        without_tolerance.report(each, 0)
    assert not without_tolerance.is_near(0.0)


def test_a_gap_that_two_decreases_did_not_narrow_is_ignored_for_a_while() -> None:
    gap = reported(1, 4, 4)
    assert [gap.try_decrease(10.0), gap.try_decrease(11.0), gap.try_decrease(12.0)] == [True, True, False]
    for _ in range(2):
        gap.report(4, 4)
    assert (gap.is_near(12.0 + REST - 0.1), gap.is_near(12.0 + REST)) == (False, True)


def test_a_gap_that_a_decrease_narrowed_may_be_tried_again() -> None:
    gap = reported(1, 4, 4)
    assert gap.try_decrease(10.0)
    gap.report(3, 4)
    assert [gap.try_decrease(11.0), gap.try_decrease(12.0), gap.try_decrease(13.0)] == [True, True, False]
