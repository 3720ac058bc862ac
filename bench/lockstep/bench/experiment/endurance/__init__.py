"""Runs sessions of hours, to see whether the console gives one up without a cause."""
