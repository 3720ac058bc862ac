"""Runs what a day of use consists of, in as many runs as it takes."""
