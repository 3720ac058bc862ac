"""Drives several robots on one console while their bridges are killed in turn, to see how that disturbs the others."""
