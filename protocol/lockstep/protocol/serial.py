"""Event references: 31-bit serial numbers (RFC 1982 with SERIAL_BITS = 31).

A reference counts executed and answered commands. It starts at 1, and its successor never is 0, because 0
means "unset" in the frame-metadata trailer. Stepping over 0 makes a gap that spans the wrap one larger than
the number of events in it: the safe side, since a larger gap is refused sooner.
"""

__all__ = ["FIRST_EVENT", "MAX_EVENT", "event_after", "event_gap", "is_event", "is_newer"]

MODULUS = 2**31
HALF = 2**30

FIRST_EVENT = 1
MAX_EVENT = MODULUS - 1


def is_event(value: int) -> bool:
    """Whether `value` can be an event reference: 1 to 2**31 - 1."""
    return FIRST_EVENT <= value <= MAX_EVENT


def event_after(event: int) -> int:
    """The reference that follows `event`."""
    return event + 1 if event < MAX_EVENT else FIRST_EVENT


def event_gap(newer: int, older: int) -> int:
    """`newer - older` in serial arithmetic (RFC 1982 3.2): -2**30 to 2**30 - 1.

    At exactly half the number space RFC 1982 leaves the order undefined; here `newer` then counts as behind.
    """
    return (newer - older + HALF) % MODULUS - HALF


def is_newer(event: int, than: int) -> bool:
    """Whether `event` comes after `than`."""
    return event_gap(event, than) > 0
