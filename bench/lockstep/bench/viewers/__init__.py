"""Clients that look on, by the hundred."""
