"""Actions of a robot at the bridge, and its status."""
