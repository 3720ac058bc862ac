"""Runs `lockstep ros2` in a Python that has ROS 2 and nothing of the console."""

from lockstep.robot_bridge.robots.ros2.discovery.cli import ros2_app

ros2_app(prog_name="lockstep ros2")
