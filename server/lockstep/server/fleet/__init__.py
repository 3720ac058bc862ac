"""Several robots on one console: a whole session each, one way in."""
