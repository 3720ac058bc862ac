"""The latched stop and the lock-out, kept on the robot's disk."""
