"""What a robot's uplink has to carry: raw pictures against encoding at the bridge."""
