"""Reads recordings by event."""
