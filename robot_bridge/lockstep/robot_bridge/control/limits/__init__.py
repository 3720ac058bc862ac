"""Limits of motion: axes, joints, positions and geofences."""
