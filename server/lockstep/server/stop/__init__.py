"""STOP and reset: kept until the robot has answered, over every restart."""
