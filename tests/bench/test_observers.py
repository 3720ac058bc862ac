import pytest

from bench.sections.observers import Counts, counts_from, missed_pictures
from bench.stack import Metrics


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


def test_a_crowds_sound_is_no_picture_that_it_could_miss() -> None:
    metrics = Metrics(
        """
lockstep_media_pictures_taken_total{stream="overview"} 100.0
lockstep_media_tier_frames_encoded_total{stream="overview",tier="crowd"} 50.0
lockstep_media_tier_frames_encoded_total{stream="microphone",tier="crowd"} 17.0
lockstep_media_frames_dropped_total{stage="peer_busy",stream="overview"} 2.0
"""
    )
    assert counts_from(metrics, []) == Counts({"overview": 100}, {"overview": 50}, 2.0, [])


def test_a_spell_without_pictures_proves_nothing() -> None:
    with pytest.raises(ValueError, match="without pictures"):
        missed_pictures(counts(100, 90), counts(100, 90))
