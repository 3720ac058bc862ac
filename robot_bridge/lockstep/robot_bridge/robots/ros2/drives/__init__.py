"""Commands as ROS 2 messages."""
