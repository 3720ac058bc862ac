"""Bounds the thread's time that a connection's data may take."""
