"""The commands that run a console."""
