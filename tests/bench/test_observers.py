import pytest

from lockstep.bench.harness.stack import Metrics
from lockstep.bench.sections.costs.observers import Counts, Missed, Received, counts_from, missed_between


def seen(*pictures: int, lost: int = 0) -> list[Received]:
    return [{"overview": [frames, lost]} for frames in pictures]


def counts(taken: int, received: list[Received], dropped: int = 0, **tiers: int) -> Counts:
    every = {"operator": taken, "crowd": 0, "low": 0} | tiers
    return Counts(
        {"overview": taken}, {tier: {"overview": number} for tier, number in every.items()}, dropped, received
    )


def test_an_observer_that_joined_late_misses_nothing_as_long_as_both_counts_grow_alike() -> None:
    found = missed_between(counts(100, seen(90, 3)), counts(150, seen(140, 53)))
    assert found == Missed(received=100, dropped=0, lost=0, mixed=0)
    assert found.percent == 0


def test_what_the_console_dropped_and_what_was_lost_on_the_way_is_missed() -> None:
    before = counts(100, seen(90, 3))
    after = counts(150, [*seen(139), *seen(53, lost=2)], dropped=1)
    found = missed_between(before, after)
    assert found == Missed(received=99, dropped=1, lost=2, mixed=1)
    assert found.percent == pytest.approx(100 * 3 / 102)


def test_each_observer_is_held_to_the_count_of_some_tiers_encoder() -> None:
    before = counts(100, seen(0, 0, 0, 0))
    after = counts(150, seen(25, 24, 50, 17), crowd=25, low=17)
    assert missed_between(before, after).mixed == 1  # 24: neither


def test_a_tier_that_was_there_before_counts_no_more() -> None:
    found = missed_between(counts(100, seen(0), crowd=50), counts(150, seen(50), crowd=50))
    assert found.mixed == 0


def test_sound_is_no_picture_that_anybody_could_miss() -> None:
    metrics = Metrics(
        """
lockstep_media_pictures_taken_total{stream="overview"} 100.0
lockstep_media_tier_frames_encoded_total{stream="overview",tier="crowd"} 50.0
lockstep_media_tier_frames_encoded_total{stream="microphone",tier="crowd"} 17.0
lockstep_media_frames_dropped_total{stage="peer_busy",stream="overview"} 2.0
lockstep_media_frames_dropped_total{stage="peer_busy",stream="microphone"} 5.0
lockstep_media_frames_dropped_total{stage="path_busy",stream="overview"} 7.0
"""
    )
    nothing: dict[str, int] = {}
    tiers = {"operator": nothing, "high": nothing, "crowd": {"overview": 50}, "low": nothing}
    assert counts_from(metrics, []) == Counts({"overview": 100}, tiers, 2, [])


def test_a_spell_without_pictures_proves_nothing() -> None:
    with pytest.raises(ValueError, match="without pictures"):
        missed_between(counts(100, seen(90)), counts(100, seen(90)))
