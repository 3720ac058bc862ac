"""`lockstep ros2 discover`: looks at a live ROS 2 graph and writes a robot's file. It publishes nothing."""
