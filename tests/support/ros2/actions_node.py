"""The robot of robot_node.py with action servers, a map and a planner. Run with ROS' Python, and the built interfaces.

More lines on standard input: `lost` and `found` (the transform from map to odom), `stubborn` (cancels are refused),
`slow` (goals are accepted a second late), `wall` (another map), `spoil_map` (a map that contradicts itself), `hide`,
`show` and `accept` (see late_action.py).
"""

import array
import math
import time
from pathlib import Path
from typing import Any

from control_msgs.action import GripperCommand
from example_interfaces.action import Fibonacci
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped
from late_action import LateAction  # type: ignore[import-not-found]  # beside this file, which is run as a script
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_node import RobotNode, main  # type: ignore[import-not-found]
from tf2_msgs.msg import TFMessage

STEP = 0.05  # s
SPEED, TURN = 0.4, 1.0  # m/s, rad/s
NEAR = 0.05  # m
OFFSET = (1.0, -0.5)  # of odom in map, m
WIDTH, HEIGHT, RESOLUTION = 80, 60, 0.1  # of the map, whose origin is (-4, -3)


class ActingRobot(RobotNode):  # type: ignore[misc]
    def __init__(self, log: Path) -> None:
        super().__init__(log)
        self._lost = self._stubborn = self._slow = False
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._maps = self.create_publisher(OccupancyGrid, "/map", kept)
        self._paths = self.create_publisher(PathMessage, "/plan", 10)
        self._frames = self.create_publisher(TFMessage, "/tf", 100)
        self._drive = self.create_publisher(TwistStamped, "/cmd_vel", 10)
        group = ReentrantCallbackGroup()
        for kind, name, run in (
            (Fibonacci, "/count", self._count),
            (NavigateToPose, "/navigate_to_pose", self._navigate),
            (GripperCommand, "/gripper_controller/gripper_cmd", self._grip),
        ):
            ActionServer(
                *(self, kind, name, run),
                callback_group=group,
                goal_callback=self._goal,
                cancel_callback=self._cancel,
            )
        self._late = LateAction(self, "/late", self.note)
        self.create_timer(0.1, self._place)
        self._mounts = self.create_publisher(TFMessage, "/tf_static", kept)
        self.mount = mount = TransformStamped()
        mount.header.frame_id, mount.child_frame_id = "base_link", "laser"
        mount.transform.rotation.z = 1.0  # it looks back
        mount.transform.rotation.w = 0.0
        self._mounts.publish(TFMessage(transforms=[mount]))
        self._publish_map(column=60)

    def tell(self, line: str) -> None:
        match line:
            case "lost" | "found":
                self._lost = line == "lost"
            case "stubborn":
                self._stubborn = True
            case "slow":
                self._slow = True
            case "hide":
                self._late.hide()
            case "show":
                self._late.show()
            case "accept":
                self._late.accept()
            case "wall":
                self._publish_map(column=20)
            case "spoil_map":
                self._maps.publish(OccupancyGrid())
            case _:
                super().tell(line)

    def _publish_map(self, column: int) -> None:
        message = OccupancyGrid()
        message.info.width, message.info.height, message.info.resolution = WIDTH, HEIGHT, RESOLUTION
        message.info.origin.position.x, message.info.origin.position.y = -4.0, -3.0
        cells = array.array("b", [0] * (WIDTH * HEIGHT))
        for row in range(HEIGHT):
            cells[row * WIDTH + column] = 100
            cells[row * WIDTH + WIDTH - 1] = -1
        message.data = cells
        self._maps.publish(message)

    def _place(self) -> None:
        if self._lost:
            return
        frame = TransformStamped()
        frame.header.frame_id, frame.child_frame_id = "map", "odom"
        frame.header.stamp = self.get_clock().now().to_msg()
        frame.transform.translation.x, frame.transform.translation.y = OFFSET
        self._frames.publish(TFMessage(transforms=[frame]))

    def _goal(self, goal: Any) -> GoalResponse:
        if self._slow:
            time.sleep(1.0)
        self.note("goal", name=type(goal).__name__)
        if getattr(goal, "order", 0) > 90:
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _cancel(self, handle: Any) -> CancelResponse:
        self.note("cancel")
        return CancelResponse.REJECT if self._stubborn else CancelResponse.ACCEPT

    def _count(self, handle: Any) -> Fibonacci.Result:
        sequence = [0, 1]
        # One that ignores cancels goes on for longer than the bridge waits for its end.
        while len(sequence) < handle.request.order * (4 if self._stubborn else 1):
            time.sleep(STEP)
            if handle.is_cancel_requested:
                handle.canceled()
                self.note("ended", how="canceled", count=len(sequence))
                return Fibonacci.Result(sequence=sequence)
            sequence.append((sequence[-1] + sequence[-2]) % 1000)  # stays within its 32 bits
            handle.publish_feedback(Fibonacci.Feedback(sequence=sequence))
        if handle.request.order == 7:
            handle.abort()
        else:
            handle.succeed()
        self.note("ended", how="done", count=len(sequence))
        return Fibonacci.Result(sequence=sequence)

    def _grip(self, handle: Any) -> GripperCommand.Result:
        """A thing of 0.02 m is between the fingers."""
        command = handle.request.command
        self.note("grip", position=command.position, effort=command.max_effort)
        position = max(command.position, 0.02)
        handle.publish_feedback(GripperCommand.Feedback(position=position))
        is_there = position == command.position
        handle.succeed() if is_there else handle.abort()
        return GripperCommand.Result(position=position, stalled=not is_there, reached_goal=is_there)

    def _navigate(self, handle: Any) -> NavigateToPose.Result:
        """Turn to the goal, drive there straight, turn to its heading."""
        pose = handle.request.pose
        self.note("navigate", frame=pose.header.frame_id, x=pose.pose.position.x, y=pose.pose.position.y)
        goal = (pose.pose.position.x - OFFSET[0], pose.pose.position.y - OFFSET[1])  # in odom
        yaw = 2 * math.atan2(pose.pose.orientation.z, pose.pose.orientation.w)
        path = PathMessage()
        path.header.frame_id = "map"
        for share in range(11):
            point = PoseStamped()
            point.pose.position.x = OFFSET[0] + self._pose[0] + (goal[0] - self._pose[0]) * share / 10
            point.pose.position.y = OFFSET[1] + self._pose[1] + (goal[1] - self._pose[1]) * share / 10
            path.poses.append(point)
        self._paths.publish(path)
        while True:
            x, y, heading = self._pose
            left = math.dist((x, y), goal)
            wanted = math.atan2(goal[1] - y, goal[0] - x) if left > NEAR else yaw
            off = math.remainder(wanted - heading, math.tau)
            if left <= NEAR and abs(off) < 0.05:
                break
            if handle.is_cancel_requested:
                self._say(0.0, 0.0)
                handle.canceled()
                self.note("ended", how="canceled")
                return NavigateToPose.Result()
            forward = SPEED if left > NEAR and abs(off) < 0.2 else 0.0
            self._say(forward, max(-TURN, min(TURN, 3 * off)))
            handle.publish_feedback(NavigateToPose.Feedback(distance_remaining=left))
            time.sleep(STEP)
        self._say(0.0, 0.0)
        handle.succeed()
        self.note("ended", how="done")
        return NavigateToPose.Result()

    def _say(self, forward: float, turn: float) -> None:
        twist = TwistStamped()
        twist.twist.linear.x, twist.twist.angular.z = forward, turn
        self._drive.publish(twist)


if __name__ == "__main__":
    main(ActingRobot, MultiThreadedExecutor)
