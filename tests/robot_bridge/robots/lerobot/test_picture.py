"""LeRobot's pictures as planes Y, U and V."""

import numpy as np
import pytest

from lockstep.robot_bridge.robots.lerobot.picture import BadPicture, to_yuv


def test_white_and_black_are_the_ends_of_the_limited_range() -> None:
    picture = np.zeros((2, 4, 3), np.uint8)
    picture[:, 2:] = 255
    assert to_yuv(picture, 4, 2) == bytes([16, 16, 235, 235] * 2) + bytes([128] * 4)


def test_an_odd_last_row_and_column_are_left_out() -> None:
    picture = np.zeros((5, 7, 3), np.uint8)
    picture[4] = picture[:, 6] = 255
    assert to_yuv(picture, 6, 4) == bytes([16] * 24 + [128] * 12)


def test_a_picture_that_is_a_view_of_another_is_taken() -> None:
    picture = np.zeros((8, 8, 3), np.uint8)[::2, ::-1]
    assert len(to_yuv(picture, 8, 4)) == 48


@pytest.mark.parametrize(
    "picture",
    [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3)), np.zeros((4, 4, 4), np.uint8), np.zeros((6, 4, 3), np.uint8)],
)
def test_another_shape_or_type_is_refused(picture: object) -> None:
    with pytest.raises(BadPicture):
        to_yuv(picture, 4, 4)
