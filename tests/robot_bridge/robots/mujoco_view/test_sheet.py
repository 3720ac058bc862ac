import av
import numpy as np
import pytest

from lockstep.robot_bridge.robots.mujoco_view.sheet import Sheet


@pytest.mark.parametrize(("width", "height"), [(640, 480), (320, 240), (100, 62), (66, 50)])
def test_a_picture_is_turned_the_right_way_up_and_converted_without_padding(width: int, height: int) -> None:
    picture = np.random.default_rng(1).integers(0, 256, (height, width, 3), dtype=np.uint8)
    sheet = Sheet(width, height)
    sheet.pixels[:, :, :3] = picture[::-1]
    expected = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format="yuv420p", threads=1).to_ndarray()
    made = np.frombuffer(sheet.yuv420p(), np.uint8).astype(int)
    assert np.abs(made - expected.ravel()).max() <= 1


def test_each_picture_overwrites_the_last() -> None:
    sheet = Sheet(64, 48)
    black = sheet.yuv420p()
    sheet.pixels[:] = 255
    white = sheet.yuv420p()
    assert (black[0], white[0]) == (16, 235)
    sheet.pixels[:] = 0
    assert sheet.yuv420p() == black
    assert white[0] == 235  # what was given away stays
