"""Watchdogs that bring the robot to rest when the bridge hangs."""
