"""A started process: its output and its usage."""
