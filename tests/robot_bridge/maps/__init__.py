"""Maps of the robot."""
