"""What a path does to packets: delay, loss, a bottleneck, outages. No I/O."""
