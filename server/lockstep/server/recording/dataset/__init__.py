"""LeRobot datasets on the disk: whole at any moment, appended to, and read back."""
