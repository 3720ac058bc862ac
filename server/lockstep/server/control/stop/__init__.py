"""Who may stop and reset the robot: what the console does with a press of STOP, and with a RESET."""
