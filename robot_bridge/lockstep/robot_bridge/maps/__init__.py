"""Maps of the robot, on their way to the console."""
