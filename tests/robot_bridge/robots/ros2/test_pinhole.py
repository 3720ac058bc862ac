"""Which pictures are rectified; what a CameraInfo says is tried in test_camera_info.py."""

from lockstep.robot_bridge.robots.ros2.pinhole import is_rectified


def test_the_name_of_a_topic_says_whether_its_pictures_are_rectified() -> None:
    assert is_rectified("/front/image_rect_color/compressed")
    assert not is_rectified("/rectifier/image_raw")
    assert not is_rectified("/")
