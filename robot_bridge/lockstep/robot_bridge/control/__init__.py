"""Events, limits and coming to rest: what the robot does with a command."""
