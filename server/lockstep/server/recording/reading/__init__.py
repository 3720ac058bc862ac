"""Recordings are read by event."""
