import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.server.media.quality.budget import FLOOR_BPS, CameraNeed, share_out

MAIN, WRIST = CameraNeed(640 * 480 * 30, 800_000), CameraNeed(320 * 240 * 15, 800_000)


def test_ample_bits_give_every_camera_its_maximum() -> None:
    assert share_out(1_600_000, [MAIN, WRIST]) == [800_000, 800_000]


def test_the_main_camera_has_the_larger_share() -> None:
    main, wrist = share_out(400_000, [MAIN, WRIST])
    assert main > 3 * wrist
    assert wrist > FLOOR_BPS


def test_the_main_camera_comes_first_when_there_is_hardly_anything() -> None:
    main, wrist = share_out(35_000, [MAIN, WRIST])
    assert main == FLOOR_BPS
    assert wrist == 10_000


def test_one_camera_gets_all() -> None:
    assert share_out(300_000, [MAIN]) == [300_000]
    assert share_out(300_000, []) == []


@settings(deadline=None)
@given(st.floats(50_000, 1e7), st.lists(st.tuples(st.floats(1e4, 1e8), st.floats(30_000, 2e6)), min_size=1, max_size=6))
def test_no_more_is_shared_out_than_there_is(total: float, cameras: list[tuple[float, float]]) -> None:
    shares = share_out(total, [CameraNeed(*camera) for camera in cameras])
    assert sum(shares) <= max(total, FLOOR_BPS + 10_000 * (len(cameras) - 1)) * 1.0001
    assert all(0 < share <= camera[1] * 1.0001 for share, camera in zip(shares, cameras, strict=True))
    assert sum(shares) == pytest.approx(min(total, sum(camera[1] for camera in cameras)), rel=0.01) or total < 100_000
