"""Who drives, and what may pass to the robot: seat, arbiter, event clock, participants."""
