from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.server.media.quality.adaptation import MIN_FRAME_RATE, SCALES, UP_AFTER, Adaptation
from lockstep.server.media.quality.encoding_target import EncodingTarget, scaled_size

SIZE = (640, 480)


def test_an_ample_bitrate_leaves_pictures_whole() -> None:
    assert Adaptation().plan(800_000, 30.0, SIZE, 0.0) == EncodingTarget(800_000, 30.0, 1.0)


def test_the_size_goes_before_the_rate_of_pictures() -> None:
    plan = Adaptation().plan(120_000, 30.0, SIZE, 0.0)
    assert plan.frame_rate == 30.0
    assert plan.size(*SIZE) == (320, 240)


def test_a_scarce_bitrate_halves_the_rate_of_pictures() -> None:
    assert Adaptation().plan(50_000, 30.0, SIZE, 0.0).frame_rate == 15.0


def test_a_smaller_size_stays_until_the_larger_one_is_well_paid() -> None:
    ladder = Adaptation()
    assert ladder.plan(200_000, 30.0, SIZE, 0.0).scale == 0.75
    assert ladder.plan(300_000, 30.0, SIZE, 60.0).scale == 0.75
    assert ladder.plan(400_000, 30.0, SIZE, 61.0).scale == 1.0


def test_a_size_that_has_just_changed_does_not_grow_at_once() -> None:
    ladder = Adaptation()
    ladder.plan(200_000, 30.0, SIZE, 0.0)
    assert ladder.plan(800_000, 30.0, SIZE, UP_AFTER - 0.1).scale == 0.75
    assert ladder.plan(800_000, 30.0, SIZE, UP_AFTER).scale == 1.0


def test_a_small_camera_is_not_made_smaller_than_a_person_can_use() -> None:
    ladder = Adaptation()
    assert min(ladder.plan(5_000, 15.0, (320, 240), 0.0).size(320, 240)) >= 90
    assert Adaptation().plan(5_000, 15.0, (160, 80), 0.0).scale == 1.0


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(1_000, 2e7), st.floats(0.01, 20)), min_size=1, max_size=20), st.floats(1, 120))
def test_plans_stay_within_what_the_camera_gives(steps: list[tuple[float, float]], frame_rate: float) -> None:
    ladder, now = Adaptation(), 0.0
    for bitrate, passed in steps:
        now += passed
        plan = ladder.plan(bitrate, frame_rate, SIZE, now)
        assert plan.scale in SCALES
        assert min(MIN_FRAME_RATE, frame_rate) / 2 <= plan.frame_rate <= frame_rate
        width, height = plan.size(*SIZE)
        assert (width % 2, height % 2) == (0, 0)
        assert abs(width / height - 4 / 3) < 0.03


@settings(deadline=None)
@given(st.integers(8, 2000).map(lambda n: 2 * n), st.integers(8, 2000).map(lambda n: 2 * n), st.sampled_from(SCALES))
def test_scaled_sizes_are_even_and_keep_the_aspect_ratio(width: int, height: int, scale: float) -> None:
    smaller = scaled_size(width, height, scale)
    assert all(side % 2 == 0 and side >= 16 for side in smaller)
    assert all(
        abs(side - whole * scale) <= 1 or side == 16 for side, whole in zip(smaller, (width, height), strict=True)
    )
