"""Asks a robot bridge that encodes for bitrate, size, rate and keyframes that its uplink carries."""
