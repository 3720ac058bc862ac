"""What a relay costs and adds, with a real Janus in a network namespace."""
