"""Decides which peers get a place. No I/O."""

from lockstep.protocol.console import Role
from lockstep.server.errors import TooManyPeers

__all__ = ["RESERVED_FOR_LINK", "check_place"]

LINK_SHARE = 3, 4  # share of the observers' places that one link may have
RESERVED_FOR_LINK = 2  # of the last places one link may have these: a page, and a program or another page


def check_place(role: Role, held: int, taken: int, bound: int, reserved: int) -> None:
    """Raise TooManyPeers unless there is a place for one more peer.

    The last `reserved` places are for people who may drive, and one of them is for a supervisor. One link cannot take
    all.

    Args:
        held: places that the peer's link has already, at most `taken`
        taken: places that all links have already
        bound: number of places
    """
    usual = max(1, bound - reserved)
    limit = usual if role in ("observer", "policy") else bound - 1 if role == "operator" and reserved > 1 else bound
    if taken >= limit:
        raise TooManyPeers(f"all {limit} places are taken")
    share = -(-usual * LINK_SHARE[0] // LINK_SHARE[1])
    if held >= share:
        raise TooManyPeers(f"this link has all of its {share} of the {bound} places; use another link")
    if taken >= usual and held >= RESERVED_FOR_LINK:
        raise TooManyPeers(f"the last {reserved} places are for links with fewer than {RESERVED_FOR_LINK}")
