"""Measures the cost and the delay of a relay, with a real Janus in a network namespace."""
