"""Checks of a robot description before the robot is driven by it."""
