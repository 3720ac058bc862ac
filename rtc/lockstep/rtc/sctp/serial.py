"""Serial numbers of a fixed width (RFC 1982) as plain integers that never wrap.

TSNs, stream sequence numbers and request numbers wrap on the wire. Inside they are unbounded integers, so that
comparing and subtracting them needs no rule: they are unwrapped once where they come in, and masked where they leave.
"""

__all__ = ["MASK_16", "MASK_32", "unwrap"]

MASK_16 = 0xFFFF
MASK_32 = 0xFFFFFFFF


def unwrap(number: int, near: int, mask: int = MASK_32) -> int:
    """Return the integer that looks like `number` on the wire and is the nearest to `near`. `mask` gives the width.

    A number that is exactly half the range away counts as older.
    """
    half = (mask + 1) >> 1
    return near - half + ((number - near + half) & mask)
