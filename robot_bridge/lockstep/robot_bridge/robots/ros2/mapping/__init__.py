"""The map of a ROS 2 robot, and its place on it."""
