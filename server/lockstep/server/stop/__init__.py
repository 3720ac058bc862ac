"""STOP and reset. Stops are kept until the robot has answered, across restarts."""
