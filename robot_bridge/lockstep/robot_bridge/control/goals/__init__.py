"""What goals mean for a robot: which command carries them, where they begin, which exclude each other."""
