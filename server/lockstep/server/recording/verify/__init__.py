"""Whether a recording keeps the promises of Lockstep, and whether it was changed."""
