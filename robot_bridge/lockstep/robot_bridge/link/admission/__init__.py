"""Admission: accepts connections, limits them by address, and decides which become links."""
