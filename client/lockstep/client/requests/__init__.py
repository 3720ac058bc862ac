"""The requests of a connection that the console or the robot answers."""
