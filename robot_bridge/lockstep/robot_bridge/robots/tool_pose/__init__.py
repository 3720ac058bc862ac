"""A tool's pose as goal axes of any robot whose joints take positions: its axes, its bindings, its drive."""
