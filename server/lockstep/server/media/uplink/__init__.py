"""What the console asks of a robot bridge that encodes: bitrate, size, rate and keyframes that its uplink carries."""
