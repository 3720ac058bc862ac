"""Maps addresses to clients for counting. No I/O."""

from lockstep.robot_bridge.link.admission.address_group import address_group

__all__ = ["NO_ADDRESS", "counted_address"]

NO_ADDRESS = "no address"  # the key of any text that is not an address, however a proxy wrote it
LONGEST = 64  # characters of an address, with its scope


def counted_address(text: str) -> str:
    """Return the key under which a client's address is counted: an IPv6 one by its /64."""
    return (address_group(text) if len(text) <= LONGEST else None) or NO_ADDRESS
