"""Starts and ends the processes of measurements and tests, and drives."""
