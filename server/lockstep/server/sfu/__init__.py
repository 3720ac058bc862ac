"""Observers by the thousand: the session goes into an SFU that others keep."""
