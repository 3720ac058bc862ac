"""A crowd that misbehaves in every way that a console should withstand, and the measured effect on its operator."""
