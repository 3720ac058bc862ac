import pytest

from lockstep.bench.experiment.judge.playout import FIRST_JITTER, LATE_IN_A_ROW, SEGMENT, SoundPlayer, heard, played
from lockstep.bench.experiment.judge.record import Arrival


def delays(*transits: float) -> list[float | None]:
    player = SoundPlayer()
    return [player.delay(transit) for transit in transits]


def test_a_spurt_is_played_at_the_transit_of_its_first_segment_and_the_jitter_measured_so_far() -> None:
    assert delays(0.1, 0.05, 0.15) == [pytest.approx(0.1 + FIRST_JITTER)] * 3


def test_what_comes_after_its_moment_is_thrown_away_and_the_spurt_goes_on() -> None:
    first = 0.1 + FIRST_JITTER
    assert delays(0.1, 0.2, 0.1) == [pytest.approx(first), None, pytest.approx(first)]


def test_some_late_ones_in_a_row_begin_a_spurt_that_is_later_for_good() -> None:
    found = delays(0.1, *[0.8] * (LATE_IN_A_ROW + 1), 0.1)
    assert found[1 : LATE_IN_A_ROW + 1] == [None] * LATE_IN_A_ROW
    later = found[LATE_IN_A_ROW + 1]
    assert later is not None
    assert later > 0.8
    assert found[-1] == later, "the delay does not come down within a spurt"


def test_late_ones_that_are_not_in_a_row_begin_none() -> None:
    assert delays(*[0.1, 0.3] * 8)[-2] == pytest.approx(0.1 + FIRST_JITTER)


def test_a_path_without_jitter_is_followed_by_half_a_segment_at_least() -> None:
    player = SoundPlayer()
    player.delay(0.1)
    for _ in range(200):
        player.delay(0.1)
    for _ in range(LATE_IN_A_ROW):
        player.delay(0.5)
    assert (player.delay(0.5) or 0) >= 0.5 + SEGMENT / 2


def test_each_is_heard_at_its_capture_and_the_delay_with_its_own_stamp() -> None:
    [first, second] = played([(10.0, 5, 0.1), (10.05, 6, 0.13)])
    assert [first.stamp, second.stamp] == [5, 6]
    assert [first.at, second.at] == pytest.approx([10.0 + FIRST_JITTER, 9.92 + 0.1 + FIRST_JITTER])


def test_the_gap_is_that_to_the_feedback_which_had_come_when_it_was_heard() -> None:
    feedbacks = [Arrival(9.0, 5), Arrival(10.03, 6), Arrival(10.05, 8), Arrival(11.0, 50)]
    found = heard(feedbacks, [(10.0, 5, 0.1), (10.4, 6, 0.5)], 2)
    assert (found.max_gap, found.beyond_tolerance, found.thrown_away) == (3, 1, 1)
    assert found.longest_delay == pytest.approx(0.1 + FIRST_JITTER)


def test_without_sound_nothing_is_beyond() -> None:
    assert heard([], [], 2) == (0, 0, 0, 0.0)
