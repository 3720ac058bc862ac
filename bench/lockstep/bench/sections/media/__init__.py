"""What pictures and sound take, from the robot to the eye and the ear."""
