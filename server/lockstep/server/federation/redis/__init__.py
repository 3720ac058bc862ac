"""The board in Redis."""
