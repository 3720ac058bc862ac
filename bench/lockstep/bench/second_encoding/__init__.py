"""What a robot's second encoding gives observers, and what it costs the operator."""
