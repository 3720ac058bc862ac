"""What Lockstep's figures are, measured: `python -m bench`."""
