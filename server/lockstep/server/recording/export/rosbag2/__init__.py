"""A session in ROS 2's messages, for bags."""
