import pytest

from bench.sections.observers import Counts, missed_pictures


def counts(taken: int, *received: int, thinned: int = 0) -> Counts:
    cameras = [{"overview": [frames, 0]} for frames in received]
    return Counts({"overview": taken}, {"overview": thinned} if thinned else {}, 0.0, cameras)


def test_an_observer_that_joined_late_misses_nothing_as_long_as_both_counts_grow_alike() -> None:
    assert missed_pictures(counts(100, 90, 3), counts(150, 140, 53)) == [0, 0]


def test_each_observer_is_held_to_the_encoders_count() -> None:
    assert missed_pictures(counts(100, 90, 3), counts(150, 139, 53)) == [1, 0]


def test_in_a_crowd_it_is_the_count_of_the_crowds_encoder_or_of_all_for_who_gets_another_tier() -> None:
    assert missed_pictures(counts(100, 0, 0, 0), counts(150, 25, 24, 50, thinned=25)) == [0, 1, 0]
    assert missed_pictures(counts(100, 0, thinned=50), counts(150, 26, thinned=75)) == [1]


def test_a_crowd_that_was_there_before_counts_no_more() -> None:
    assert missed_pictures(counts(100, 0, thinned=50), counts(150, 50, thinned=50)) == [0]


def test_a_spell_without_pictures_proves_nothing() -> None:
    with pytest.raises(ValueError, match="without pictures"):
        missed_pictures(counts(100, 90), counts(100, 90))
