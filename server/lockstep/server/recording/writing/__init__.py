"""The session is written to disk by a thread."""
