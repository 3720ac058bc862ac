"""A robot with all that `lockstep ros2 discover` writes. Run with ROS' Python, and the built interfaces.

More on standard input: as for actions_node.py and services_node.py.
"""

from pathlib import Path

from actions_node import ActingRobot  # type: ignore[import-not-found]  # beside this file, which is run as a script
from geometry_msgs.msg import TransformStamped
from rclpy.executors import MultiThreadedExecutor
from robot_node import HEIGHT, WIDTH, main  # type: ignore[import-not-found]
from sensor_msgs.msg import CameraInfo
from services_node import ServingRobot  # type: ignore[import-not-found]
from tf2_msgs.msg import TFMessage

EVERY = 0.2  # s


class WholeRobot(ActingRobot, ServingRobot):  # type: ignore[misc]
    def __init__(self, log: Path) -> None:
        super().__init__(log)
        self._infos = self.create_publisher(CameraInfo, "/camera/camera_info", 10)
        mount = TransformStamped()
        mount.header.frame_id, mount.child_frame_id = "base_link", "camera_optical"
        mount.transform.translation.x, mount.transform.translation.z = 0.25, 0.3
        turn = mount.transform.rotation
        turn.w, turn.x, turn.y, turn.z = 0.5, -0.5, 0.5, -0.5  # it looks ahead
        self._mounts.publish(TFMessage(transforms=[self.mount, mount]))
        self.create_timer(EVERY, self._inform)

    def _inform(self) -> None:
        info = CameraInfo(width=2 * WIDTH, height=2 * HEIGHT)  # of the full size; the pictures are half of it
        info.header.frame_id = "camera_optical"
        info.header.stamp = self.get_clock().now().to_msg()
        info.k = [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0]
        info.distortion_model, info.d = "plumb_bob", [0.0] * 5
        self._infos.publish(info)


if __name__ == "__main__":
    main(WholeRobot, MultiThreadedExecutor)
