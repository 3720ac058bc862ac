"""Encoders, and what their output looks like on the wire."""
