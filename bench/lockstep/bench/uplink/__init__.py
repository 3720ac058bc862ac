"""Measures the load of a robot's uplink: raw pictures against encoding at the bridge."""
