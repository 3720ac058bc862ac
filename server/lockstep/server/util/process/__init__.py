"""What one process asks of the system: memory, garbage collection, files."""
