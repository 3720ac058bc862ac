"""Frames between a process and the helper process that it started."""
