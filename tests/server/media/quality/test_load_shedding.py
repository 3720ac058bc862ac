"""How many pictures a crowd gets, and that its edge is no hinge."""

from lockstep.server.media.quality.encoding_target import EncodingTarget
from lockstep.server.media.quality.load_shedding import AFTER, FULL, LONGEST, MOST, LoadShedding


def test_up_to_its_size_everybody_gets_everything() -> None:
    assert [LoadShedding(60).watch(observers, 0.0) for observers in (0, 1, 59, 60)] == [1, 1, 1, 1]


def test_beyond_it_each_gets_half_and_far_beyond_it_a_third() -> None:
    assert [LoadShedding(60).watch(observers, 0.0) for observers in (61, 150, 151, 1000)] == [2, 2, 3, 3]


def test_a_crowd_that_shrinks_gets_more_only_after_a_while_below_the_edge() -> None:
    crowd = LoadShedding(60)
    crowd.watch(61, 0.0)
    assert crowd.watch(47, 1.0) == 2
    assert crowd.watch(47, 1.0 + AFTER - 0.1) == 2
    assert crowd.watch(47, 1.0 + AFTER) == 1


def test_one_who_comes_and_goes_at_the_edge_changes_nothing() -> None:
    crowd = LoadShedding(60)
    assert {crowd.watch(60 + second % 2, float(second)) for second in range(1, 100)} == {2}


def test_a_short_absence_begins_the_wait_anew() -> None:
    crowd = LoadShedding(60)
    crowd.watch(61, 0.0)
    crowd.watch(40, 1.0)
    crowd.watch(61, 4.0)
    assert crowd.watch(40, 5.0) == 2
    assert crowd.watch(40, 9.9) == 2
    assert crowd.watch(40, 10.0) == 1


def test_from_a_third_it_goes_to_a_half_or_straight_to_all() -> None:
    for left, divisor in ((100, 2), (10, 1)):
        crowd = LoadShedding(60)
        crowd.watch(200, 0.0)
        crowd.watch(left, 1.0)
        assert crowd.watch(left, 1.0 + AFTER) == divisor


def test_a_crowd_of_two_is_one_beyond_one() -> None:
    crowd = LoadShedding(1)
    assert crowd.watch(2, 0.0) == 2
    crowd.watch(0, 1.0)
    assert crowd.watch(0, 1.0 + AFTER) == 1


def crowd_of(observers: int) -> LoadShedding:
    crowd = LoadShedding(60)
    crowd.watch(observers, 0.0)
    return crowd


def seconds_of(crowd: LoadShedding, load: float, seconds: int, begin: int) -> list[int]:
    """The divisor after each second of such a load."""
    found = []
    for now in range(begin, begin + seconds):
        crowd.loaded(load, float(now))
        found.append(crowd.divisor)
    return found


def test_a_crowd_whose_work_fills_the_loop_gets_fewer_pictures_every_two_seconds() -> None:
    assert seconds_of(crowd_of(100), 0.95, 12, 1) == [2, 3, 3, 4, 4, 5, 5, 6, 6, 6, 6, 6]
    assert MOST == 6


def test_a_full_second_now_and_then_changes_nothing() -> None:
    crowd = crowd_of(100)
    for now in range(50):
        crowd.loaded(1.0 if now % 2 else 0.5, float(now))
    assert crowd.divisor == 2


def test_whoever_is_no_crowd_gets_everything_however_full_the_loop() -> None:
    crowd = crowd_of(60)
    assert set(seconds_of(crowd, 1.0, 20, 1)) == {1}
    crowd.watch(61, 21.0)
    assert crowd.divisor == 2, "what happened before was remembered"


def test_a_step_comes_back_only_where_there_is_room_for_it() -> None:
    crowd = crowd_of(100)
    assert seconds_of(crowd, 0.9, 4, 1)[-1] == 4
    assert set(seconds_of(crowd, 0.7, 60, 5)) == {4}, "half of that are pictures: a third more of them do not fit"
    assert seconds_of(crowd, 0.5, 7, 65) == [4, 4, 4, 4, 4, 3, 3]
    assert seconds_of(crowd, 0.3, 20, 72)[-1] == 2


def test_a_step_that_is_taken_again_soon_comes_back_ever_later() -> None:
    crowd = crowd_of(100)
    now, waits = 0, []
    for _ in range(8):
        while crowd.divisor < 3:
            now += 1
            crowd.loaded(FULL + 0.05, float(now))
        began = now
        while crowd.divisor > 2:
            now += 1
            crowd.loaded(0.4, float(now))
        waits.append(now - began - 1)
    assert waits == [5, 10, 20, 40, 80, 160, 160, 160]
    assert waits[-1] == LONGEST


def test_when_the_crowd_is_gone_everybody_gets_everything_and_its_steps_are_forgotten() -> None:
    crowd = crowd_of(100)
    seconds_of(crowd, 1.0, 10, 1)
    crowd.watch(10, 11.0)
    assert crowd.watch(10, 11.0 + AFTER) == 1
    crowd.loaded(0.2, 17.0)
    assert crowd.watch(100, 18.0) == 2


def test_a_thinned_picture_has_as_many_bits_as_before() -> None:
    plan = EncodingTarget(800_000, 30.0, 0.5)
    thinned = plan.thinned(2)
    assert thinned == EncodingTarget(400_000, 15.0, 0.5)
    assert thinned.bitrate_bps / thinned.frame_rate == plan.bitrate_bps / plan.frame_rate
