"""When a command may leave, and what became of it."""
