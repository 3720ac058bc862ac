"""Plays a robot on ROS 2 topics: a base, an arm, a laser scanner, a force sensor and a camera. Run with ROS' Python.

It does what it is told until it is told otherwise, with no timeout of its own, so that whoever forgets a zero is found
out. Each command and each picture is a JSON line in the log. Lines on standard input: `hush TOPIC`, `speak TOPIC`,
`freeze TOPIC` (sends the same message over and over), `spoil TOPIC` (one message that makes no sense), `status N`
(of MoveIt Servo), `tick` (nothing). Each is answered after the robot's next tick.
"""

import array
import io
import json
import math
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import rclpy
from geometry_msgs.msg import Twist, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CompressedImage, Image, JointState, LaserScan
from std_msgs.msg import Float64MultiArray, Int8, String
from trajectory_msgs.msg import JointTrajectory

from lockstep.robot_bridge.robots.event_strip import draw_event_strip

JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
URDF = Path(__file__).with_name("robot.urdf")
WIDTH, HEIGHT = 320, 240
TICK = 0.02  # s
PICTURE_EVERY, SCAN_EVERY = 3, 4  # ticks
ARM_SPEED = 3.0  # 1/s, how fast a joint closes on its setpoint
WALL = 3.0  # m from the origin, all around


class RobotNode(Node):  # type: ignore[misc]
    def __init__(self, log: Path) -> None:
        super().__init__("test_robot")
        self._log = log.open("a", buffering=1)
        self._pose = [0.0, 0.0, 0.0]
        self._twist = [0.0, 0.0]
        self._positions = [0.0, -1.0, 1.0, 0.0, 0.0, 0.0]
        self._setpoints = list(self._positions)
        self._velocities = [0.0] * len(JOINTS)
        self._takes_positions = False  # the controller of a Float64MultiArray
        self._commanded: list[float] = []  # velocities; empty: the joints go to their setpoints
        self._ticks = 0
        self.ticked = threading.Event()
        self._pictures = 0
        self._captured = 0.0  # s, when the message that is made now shows the robot
        self._hushed: set[str] = set()
        self._frozen: dict[str, Any] = {}
        self._spoilt: set[str] = set()
        self._topics = {
            "/odom": self.create_publisher(Odometry, "/odom", 10),
            "/joint_states": self.create_publisher(JointState, "/joint_states", 10),
            "/scan": self.create_publisher(LaserScan, "/scan", qos_profile_sensor_data),
            "/wrench": self.create_publisher(WrenchStamped, "/force_torque_sensor_broadcaster/wrench", 10),
            "/image": self.create_publisher(Image, "/camera/image_raw", qos_profile_sensor_data),
            "/jpeg": self.create_publisher(
                CompressedImage, "/wrist_camera/image_raw/compressed", qos_profile_sensor_data
            ),
        }
        self.create_subscription(TwistStamped, "/cmd_vel", self._take_stamped, 10)
        self.create_subscription(Twist, "/cmd_vel_plain", self._take_twist, 10)
        self.create_subscription(
            JointTrajectory, "/joint_trajectory_controller/joint_trajectory", self._take_trajectory, 10
        )
        self.create_subscription(JointState, "/joint_command", self._take_joints, 10)
        self.create_subscription(Float64MultiArray, "/arm_velocity_controller/commands", self._take_velocities, 10)
        self.create_subscription(TwistStamped, "/servo_node/delta_twist_cmds", self._take_tool, 10)
        self._status = self.create_publisher(Int8, "/servo_node/status", 10)
        self._status_code = 0
        self.declare_parameter("joints", list(JOINTS))  # as the controllers of ros2_control have it
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._description = self.create_publisher(String, "/robot_description", kept)
        self._description.publish(String(data=URDF.read_text()))
        self.create_timer(TICK, self._tick)

    def tell(self, line: str) -> None:
        """One line of standard input."""
        verb, _, topic = line.partition(" ")
        if verb == "hush":
            self._hushed.add(topic)
        elif verb == "speak":
            self._hushed.discard(topic)
            self._frozen.pop(topic, None)
        elif verb == "freeze":
            self._frozen[topic] = None
        elif verb == "status":
            self._status_code = int(topic)
        elif verb == "positions":
            self._takes_positions = True
        elif verb == "spoil":
            self._spoilt.add(topic)

    def note(self, kind: str, **fields: object) -> None:
        self._log.write(json.dumps({"kind": kind, "time": time.monotonic(), **fields}) + "\n")

    def _take_stamped(self, message: TwistStamped) -> None:
        self._take_twist(message.twist)

    def _take_twist(self, twist: Twist) -> None:
        self._twist = [twist.linear.x, twist.angular.z]
        self.note("twist", values=self._twist)

    def _take_trajectory(self, message: JointTrajectory) -> None:
        point = message.points[0]
        span = point.time_from_start.sec + point.time_from_start.nanosec / 1e9
        self._setpoints, self._commanded = list(point.positions), []
        self.note(
            "trajectory",
            names=list(message.joint_names),
            positions=self._setpoints,
            span=span,
            measured=self._positions,
        )

    def _take_joints(self, message: JointState) -> None:
        self._setpoints, self._commanded = list(message.position), []
        self.note("joints", positions=self._setpoints, velocities=list(message.velocity), measured=self._positions)

    def _take_velocities(self, message: Float64MultiArray) -> None:
        """A velocity controller without a timeout: it goes on with what it was told last; or one of positions."""
        if self._takes_positions:
            self._setpoints, self._commanded = list(message.data), []
            self.note("positions", positions=self._setpoints)
            return
        self._commanded = list(message.data)
        self.note("velocities", values=self._commanded)

    def _take_tool(self, message: TwistStamped) -> None:
        """As MoveIt Servo, roughly: twists of the tool become velocities of joints, one each."""
        linear, angular = message.twist.linear, message.twist.angular
        self._commanded = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
        self.note("tool", values=self._commanded, frame=message.header.frame_id)

    def _tick(self) -> None:
        self._ticks += 1
        self._status.publish(Int8(data=self._status_code))
        forward, turn = self._twist
        x, y, yaw = self._pose
        yaw = math.remainder(yaw + turn * TICK, math.tau)
        self._pose = [x + forward * math.cos(yaw) * TICK, y + forward * math.sin(yaw) * TICK, yaw]
        for number, (point, position) in enumerate(zip(self._setpoints, self._positions, strict=True)):
            velocity = self._commanded[number] if self._commanded else ARM_SPEED * (point - position)
            self._velocities[number] = velocity if abs(velocity) > 1e-4 else 0.0
            self._positions[number] += self._velocities[number] * TICK
        self._send("/odom", self._odometry)
        self._send("/joint_states", self._joint_states)
        self._send("/wrench", self._wrench)
        if self._ticks % SCAN_EVERY == 0:
            self._send("/scan", self._scan)
        if self._ticks % PICTURE_EVERY == 0:
            self._pictures += 1
            self._send("/image", self._image)
            self._send("/jpeg", self._jpeg)
        self.ticked.set()

    def _send(self, topic: str, make: Any) -> None:
        if topic in self._hushed:
            return
        stamp = self.get_clock().now().to_msg()
        self._captured = time.monotonic()  # no sooner than the stamp says, or a pause between them would be its lie
        message = self._frozen.get(topic) or make(stamp, topic in self._spoilt)
        self._spoilt.discard(topic)
        if topic in self._frozen:
            self._frozen[topic] = message
        self._topics[topic].publish(message)

    def _odometry(self, stamp: Any, spoilt: bool) -> Odometry:
        message = Odometry()
        message.header.stamp = stamp
        position, turn = message.pose.pose.position, message.pose.pose.orientation
        position.x, position.y = (math.nan if spoilt else self._pose[0]), self._pose[1]
        turn.w, turn.z = math.cos(self._pose[2] / 2), math.sin(self._pose[2] / 2)
        message.twist.twist.linear.x, message.twist.twist.angular.z = self._twist
        return message

    def _joint_states(self, stamp: Any, spoilt: bool) -> JointState:
        message = JointState()
        message.header.stamp = stamp
        message.name = ["some_gripper", *JOINTS]
        message.position = [0.5, *self._positions][: 3 if spoilt else None]
        message.velocity = [0.0, *self._velocities]
        return message

    def _wrench(self, stamp: Any, spoilt: bool) -> WrenchStamped:
        message = WrenchStamped()
        message.header.stamp = stamp
        message.wrench.force.z = math.nan if spoilt else -10.0 * self._positions[0]
        return message

    def _scan(self, stamp: Any, spoilt: bool) -> LaserScan:
        message = LaserScan()
        message.header.stamp, message.header.frame_id = stamp, "laser"
        message.angle_min, message.angle_max = -math.pi, math.pi
        message.angle_increment = 0.0 if spoilt else math.tau / 360
        message.range_min, message.range_max = 0.1, 12.0
        message.ranges = [math.inf] * 360
        ahead = min(max(WALL - self._pose[0], 0.2), 7.9)
        message.ranges[170:190] = array.array("f", [ahead] * 20)
        return message

    def _picture(self) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """The picture's number in the strip that elsewhere has the event; dots for the base's and a joint's place."""
        grey = np.full((HEIGHT, WIDTH), 60, np.uint8)
        draw_event_strip(grey, self._pictures)
        picture = np.repeat(grey[:, :, None], 3, axis=2)
        joint = int(WIDTH / 2 + self._positions[0] * 100) % WIDTH
        picture[HEIGHT - 30 : HEIGHT - 10, max(0, joint - 10) : joint + 10] = (60, 200, 120)
        x = int(WIDTH / 2 + self._pose[0] * 50) % WIDTH
        y = HEIGHT // 2 + int(self._pose[1] * 50) % (HEIGHT // 2)
        picture[max(14, y - 10) : y + 10, max(0, x - 10) : x + 10] = (240, 120, 30)
        return picture

    def _image(self, stamp: Any, spoilt: bool) -> Image:
        picture = self._picture()
        message = Image()
        message.header.stamp = stamp
        message.width, message.height, message.encoding = WIDTH, HEIGHT, "16UC1" if spoilt else "rgb8"
        message.step = 3 * WIDTH
        message.data = array.array("B", picture.tobytes())
        self.note("picture", number=self._pictures, captured=self._captured)
        return message

    def _jpeg(self, stamp: Any, spoilt: bool) -> CompressedImage:
        encoded = io.BytesIO()
        PIL.Image.fromarray(self._picture()).save(encoded, "JPEG", quality=85)
        message = CompressedImage()
        message.header.stamp = stamp
        message.format = "rgb8; jpeg compressed bgr8"
        message.data = array.array("B", b"no JPEG" if spoilt else encoded.getvalue())
        self.note("jpeg", number=self._pictures, captured=self._captured)
        return message


def listen(node: RobotNode) -> None:
    for line in sys.stdin:
        node.tell(line.strip())
        node.ticked.clear()
        node.ticked.wait()
        print(json.dumps({"done": line.strip()}), flush=True)


def main(kind: type[RobotNode] = RobotNode, make_executor: type[Executor] = SingleThreadedExecutor) -> None:
    rclpy.init()
    node = kind(Path(sys.argv[1]))
    executor = make_executor()
    executor.add_node(node)
    threading.Thread(target=listen, args=(node,), daemon=True).start()
    print(json.dumps({"ready": True}), flush=True)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()


if __name__ == "__main__":
    main()
