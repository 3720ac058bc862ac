"""The thesis' experiments on emulated networks: `lockstep experiment`."""
