"""Actions of the robot, and its status, at the console."""
