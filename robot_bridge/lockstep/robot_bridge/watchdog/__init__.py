"""What brings the robot to rest when the bridge hangs."""
