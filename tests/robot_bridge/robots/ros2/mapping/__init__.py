"""Maps of a ROS 2 robot."""
