"""Recorded sessions: the files and their episodes."""
