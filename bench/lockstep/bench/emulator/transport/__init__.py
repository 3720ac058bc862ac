"""Relays through which UDP, TCP, HTTP and WebSockets pass a path."""
