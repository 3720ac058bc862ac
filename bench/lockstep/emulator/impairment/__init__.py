"""The impairments of packets on a path: delay, loss, a bottleneck, outages. No I/O."""
