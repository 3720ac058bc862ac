"""Whether a robot description can be driven by."""
