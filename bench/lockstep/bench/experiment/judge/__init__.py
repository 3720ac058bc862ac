"""Evaluates runs: measures, tables, figures."""
