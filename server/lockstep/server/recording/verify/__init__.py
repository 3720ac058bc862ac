"""Checks that a recording keeps the promises of Lockstep, and that it was not changed."""
