"""Traces: the spans of the two ways, and the messages that carry them (docs/traces.md)."""
