"""The robot's ticks: when they come, what begins one, and what is prepared before it."""
