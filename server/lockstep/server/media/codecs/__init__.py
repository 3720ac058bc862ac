"""Encoders, and the form of their output on the wire."""
