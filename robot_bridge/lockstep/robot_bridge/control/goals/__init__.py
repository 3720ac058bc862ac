"""Goals of a robot's axes: which command carries them, where they begin, which of them exclude each other."""
