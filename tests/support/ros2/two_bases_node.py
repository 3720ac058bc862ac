"""Plays two bases on one graph, in the namespaces /robot1 and /robot2, as one process. Run with ROS' Python.

Each command is a JSON line in the log, with the robot's name. Each line on standard input is answered after a tick.
"""

import json
import math
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

TICK = 0.02  # s


class Base(Node):  # type: ignore[misc]
    def __init__(self, name: str, log: Any) -> None:
        super().__init__("base", namespace=name)
        self._name, self._log = name, log
        self._x, self._yaw = 0.0, 0.0
        self._twist = [0.0, 0.0]
        self.ticked = threading.Event()
        self._odometry = self.create_publisher(Odometry, "odom", 10)
        self.create_subscription(TwistStamped, "cmd_vel", self._take, 10)
        self.create_timer(TICK, self._tick)

    def _take(self, message: TwistStamped) -> None:
        self._twist = [message.twist.linear.x, message.twist.angular.z]
        note = {"kind": "twist", "time": time.monotonic(), "robot": self._name, "values": self._twist}
        self._log.write(json.dumps(note) + "\n")

    def _tick(self) -> None:
        self._yaw += self._twist[1] * TICK
        self._x += self._twist[0] * math.cos(self._yaw) * TICK
        message = Odometry()
        message.header.stamp = self.get_clock().now().to_msg()
        message.header.frame_id, message.child_frame_id = "odom", "base_link"
        message.pose.pose.position.x = self._x
        message.pose.pose.orientation.w = math.cos(self._yaw / 2)
        message.pose.pose.orientation.z = math.sin(self._yaw / 2)
        message.twist.twist.linear.x, message.twist.twist.angular.z = self._twist
        self._odometry.publish(message)
        self.ticked.set()


def listen(base: Base) -> None:
    for line in sys.stdin:
        base.ticked.clear()
        base.ticked.wait()
        print(json.dumps({"done": line.strip()}), flush=True)


def main() -> None:
    rclpy.init()
    with Path(sys.argv[1]).open("a", buffering=1) as log, suppress(KeyboardInterrupt, ExternalShutdownException):
        bases = [Base(name, log) for name in ("robot1", "robot2")]
        executor = SingleThreadedExecutor()
        for base in bases:
            executor.add_node(base)
        threading.Thread(target=listen, args=(bases[0],), daemon=True).start()
        print(json.dumps({"ready": True}), flush=True)
        executor.spin()


if __name__ == "__main__":
    main()
