"""Actions of the robot that are services or actions of ROS 2."""
