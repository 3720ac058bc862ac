"""Several robots on one console: a session for each robot, one address for all."""
