"""Measures Lockstep's figures: `python -m bench`."""
