"""Operators and observers that are connected: what they may say, and what they are told."""
