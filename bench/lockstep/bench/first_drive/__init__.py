"""Times a new user's first drive: `python -m lockstep.bench.first_drive`."""
