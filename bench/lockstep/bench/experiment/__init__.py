"""Runs the thesis' experiments on emulated networks: `lockstep experiment`."""
