"""Policies: programs that drive when a person offers them the control seat, or that only show what they would do."""
