import pytest

from bench.sections.observers import Counts, missed_pictures


def counts(encoded: int, *received: int) -> Counts:
    return Counts({"overview": encoded}, 0.0, [{"overview": [frames, 0]} for frames in received])


def test_an_observer_that_joined_late_misses_nothing_as_long_as_both_counts_grow_alike() -> None:
    assert missed_pictures(counts(100, 90, 3), counts(150, 140, 53)) == [0, 0]


def test_each_observer_is_held_to_the_encoders_count() -> None:
    assert missed_pictures(counts(100, 90, 3), counts(150, 139, 53)) == [1, 0]


def test_a_spell_without_pictures_proves_nothing() -> None:
    with pytest.raises(ValueError, match="without pictures"):
        missed_pictures(counts(100, 90), counts(100, 90))
