"""Builds a console: its apps, and each robot's session."""
