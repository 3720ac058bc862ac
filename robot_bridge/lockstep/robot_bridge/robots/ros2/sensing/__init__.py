"""Reads ROS 2 messages as feedback and pictures."""
