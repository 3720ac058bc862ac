"""A simulated base like a TurtleBot, on ROS 2 topics: python turtlebot.py, with a Python that has rclpy.

It takes TwistStamped on /cmd_vel, and publishes /odom, /scan and /camera/image_raw, as base.yaml describes it. It comes
to rest 0.5 s after the last command, as diff_drive_controller does. The room is a square of 6 m around the origin.
"""

import math
from contextlib import suppress

import numpy as np
import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image, LaserScan

WALL, RADIUS = 3.0, 0.25  # m
TICK, TIMEOUT = 0.02, 0.5  # s
RAYS, WIDTH, HEIGHT = 180, 320, 240
FIELD = math.radians(70)  # of the camera


class TurtleBot(Node):
    def __init__(self):
        super().__init__("turtlebot")
        self.x = self.y = self.yaw = self.forward = self.turn = 0.0
        self.commanded = self.get_clock().now()
        self.ticks = 0
        self.create_subscription(TwistStamped, "/cmd_vel", self.take, 10)
        self.odometry = self.create_publisher(Odometry, "/odom", 10)
        self.scans = self.create_publisher(LaserScan, "/scan", qos_profile_sensor_data)
        self.images = self.create_publisher(Image, "/camera/image_raw", qos_profile_sensor_data)
        self.create_timer(TICK, self.tick)

    def take(self, message):
        self.commanded = self.get_clock().now()
        self.set_speed(message.twist.linear.x, message.twist.angular.z)

    def set_speed(self, forward, turn):
        if (forward == 0 and turn == 0) != (self.forward == 0 and self.turn == 0):
            print("at rest" if forward == 0 and turn == 0 else "moving", flush=True)
        self.forward, self.turn = forward, turn

    def tick(self):
        now = self.get_clock().now()
        if (now - self.commanded).nanoseconds > TIMEOUT * 1e9:
            self.set_speed(0.0, 0.0)
        self.yaw = math.remainder(self.yaw + self.turn * TICK, math.tau)
        free = WALL - RADIUS
        self.x = min(max(self.x + self.forward * math.cos(self.yaw) * TICK, -free), free)
        self.y = min(max(self.y + self.forward * math.sin(self.yaw) * TICK, -free), free)
        self.ticks += 1
        self.publish_odometry(now.to_msg())
        if self.ticks % 5 == 0:
            self.publish_scan(now.to_msg())
        if self.ticks % 3 == 0:
            self.publish_image(now.to_msg())

    def publish_odometry(self, stamp):
        message = Odometry()
        message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, "odom", "base_link"
        message.pose.pose.position.x, message.pose.pose.position.y = self.x, self.y
        message.pose.pose.orientation.w = math.cos(self.yaw / 2)
        message.pose.pose.orientation.z = math.sin(self.yaw / 2)
        message.twist.twist.linear.x, message.twist.twist.angular.z = self.forward, self.turn
        self.odometry.publish(message)

    def distances(self, angles):
        """From the robot to the walls, by angles in its own frame."""
        across, up = np.cos(self.yaw + angles), np.sin(self.yaw + angles)
        with np.errstate(divide="ignore"):
            sides = (np.copysign(WALL, across) - self.x) / across, (np.copysign(WALL, up) - self.y) / up
        return np.minimum(*sides)

    def publish_scan(self, stamp):
        message = LaserScan()
        message.header.stamp, message.header.frame_id = stamp, "base_link"
        message.angle_min, message.angle_increment = -math.pi, math.tau / RAYS
        message.angle_max = message.angle_min + message.angle_increment * (RAYS - 1)
        message.range_min, message.range_max = 0.1, 8.0
        angles = message.angle_min + message.angle_increment * np.arange(RAYS)
        message.ranges = self.distances(angles).astype(np.float32).tolist()
        self.scans.publish(message)

    def publish_image(self, stamp):
        """What a camera in front sees: walls that are taller and brighter the nearer they are."""
        angles = FIELD / 2 - FIELD * np.arange(WIDTH) / WIDTH
        depths = self.distances(angles) * np.cos(angles)
        rows = np.abs(np.arange(HEIGHT)[:, None] - HEIGHT / 2)
        wall = rows < 60 / depths
        stripes = np.floor((self.yaw + angles) * 12) % 2  # so that a turn is seen
        picture = np.full((HEIGHT, WIDTH, 3), (60, 64, 72), np.uint8)
        picture[HEIGHT // 2 :] = (110, 104, 96)
        shade = (200 / (1 + 0.3 * depths) * (0.8 + 0.2 * stripes)).astype(np.uint8)
        picture[wall] = np.broadcast_to(shade[None, :, None], picture.shape)[wall]
        message = Image()
        message.header.stamp, message.header.frame_id = stamp, "camera"
        message.width, message.height, message.step, message.encoding = WIDTH, HEIGHT, 3 * WIDTH, "rgb8"
        message.data = picture.tobytes()
        self.images.publish(message)


rclpy.init()
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(TurtleBot())
