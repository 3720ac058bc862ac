"""Writes the session to disk on a thread."""
