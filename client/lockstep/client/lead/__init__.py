"""`lockstep drive --teleop`: a leader arm of LeRobot drives goal axes through a clutch."""
