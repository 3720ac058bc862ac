"""Drives a robot along what was recorded, by the same rules as every operator."""
