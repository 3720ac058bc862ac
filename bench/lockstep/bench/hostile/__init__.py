"""A crowd that misbehaves in every way that a console should withstand, and what its operator feels of it."""
