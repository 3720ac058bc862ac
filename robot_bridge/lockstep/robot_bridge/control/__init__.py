"""Execution of commands: events, limits and coming to rest."""
