"""Who gets one of the places for peers. No I/O."""

from lockstep.protocol.console import Role
from lockstep.server.errors import TooManyPeers

__all__ = ["RESERVED_FOR_LINK", "check_place"]

LINK_SHARE = 3, 4  # of the places for observers, that one link may have
RESERVED_FOR_LINK = 2  # of the last places, that one link may have: a page, and a program or another page


def check_place(role: Role, held: int, taken: int, bound: int, reserved: int) -> None:
    """Raises TooManyPeers unless there is a place for one more.

    The last `reserved` places are not for observers, and of these one is for a supervisor. One link cannot take all.

    Args:
        held: places that its link has already, at most `taken`
        taken: by everybody
        bound: places that there are
    """
    usual = max(1, bound - reserved)
    limit = usual if role == "observer" else bound - 1 if role == "operator" and reserved > 1 else bound
    if taken >= limit:
        raise TooManyPeers(f"all {limit} places are taken")
    share = -(-usual * LINK_SHARE[0] // LINK_SHARE[1])
    if held >= share:
        raise TooManyPeers(f"one link gets {share} of the {bound} places; others need another one")
    if taken >= usual and held >= RESERVED_FOR_LINK:
        raise TooManyPeers(f"of the last {reserved} places one link gets none beyond {RESERVED_FOR_LINK}")
