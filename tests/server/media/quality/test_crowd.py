"""How many pictures a crowd gets, and that its edge is no hinge."""

from server.media.quality.crowd import AFTER, Crowd
from server.media.quality.plan import PicturePlan


def test_up_to_its_size_everybody_gets_everything() -> None:
    assert [Crowd(60).watch(observers, 0.0) for observers in (0, 1, 59, 60)] == [1, 1, 1, 1]


def test_beyond_it_each_gets_half_and_far_beyond_it_a_third() -> None:
    assert [Crowd(60).watch(observers, 0.0) for observers in (61, 150, 151, 1000)] == [2, 2, 3, 3]


def test_a_crowd_that_shrinks_gets_more_only_after_a_while_below_the_edge() -> None:
    crowd = Crowd(60)
    crowd.watch(61, 0.0)
    assert crowd.watch(47, 1.0) == 2
    assert crowd.watch(47, 1.0 + AFTER - 0.1) == 2
    assert crowd.watch(47, 1.0 + AFTER) == 1


def test_one_who_comes_and_goes_at_the_edge_changes_nothing() -> None:
    crowd = Crowd(60)
    assert {crowd.watch(60 + second % 2, float(second)) for second in range(1, 100)} == {2}


def test_a_short_absence_begins_the_wait_anew() -> None:
    crowd = Crowd(60)
    crowd.watch(61, 0.0)
    crowd.watch(40, 1.0)
    crowd.watch(61, 4.0)
    assert crowd.watch(40, 5.0) == 2
    assert crowd.watch(40, 9.9) == 2
    assert crowd.watch(40, 10.0) == 1


def test_from_a_third_it_goes_to_a_half_or_straight_to_all() -> None:
    for left, divisor in ((100, 2), (10, 1)):
        crowd = Crowd(60)
        crowd.watch(200, 0.0)
        crowd.watch(left, 1.0)
        assert crowd.watch(left, 1.0 + AFTER) == divisor


def test_a_crowd_of_two_is_one_beyond_one() -> None:
    crowd = Crowd(1)
    assert crowd.watch(2, 0.0) == 2
    crowd.watch(0, 1.0)
    assert crowd.watch(0, 1.0 + AFTER) == 1


def test_a_thinned_picture_has_as_many_bits_as_before() -> None:
    plan = PicturePlan(800_000, 30.0, 0.5)
    thinned = plan.thinned(2)
    assert thinned == PicturePlan(400_000, 15.0, 0.5)
    assert thinned.bitrate_bps / thinned.frame_rate == plan.bitrate_bps / plan.frame_rate
