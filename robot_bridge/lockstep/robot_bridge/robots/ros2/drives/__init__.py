"""Sends commands as ROS 2 messages."""
