"""Connections to a console and to a Janus."""
