"""A ROS 2 robot for tests: a real node in a process of its own, over DDS on loopback."""
