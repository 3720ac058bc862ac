"""The robot's side of Lockstep: owns the event reference and executes each command at most once."""
