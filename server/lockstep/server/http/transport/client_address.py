"""Maps addresses to clients for counting. No I/O."""

import ipaddress
from functools import lru_cache

__all__ = ["NO_ADDRESS", "counted_address"]

NO_ADDRESS = "no address"  # the key of any text that is not an address, however a proxy wrote it
LONGEST = 64  # characters of an address, with its scope
HOST_BITS = 64  # of an IPv6 address: a client owns at least a /64


@lru_cache(maxsize=4096)
def _counted(text: str) -> str:
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        return NO_ADDRESS
    if isinstance(address, ipaddress.IPv4Address):
        return str(address)
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return f"{ipaddress.IPv6Address(int(address) >> HOST_BITS << HOST_BITS)}/{128 - HOST_BITS}"


def counted_address(text: str) -> str:
    """Return the key under which a client's address is counted: an IPv6 one by its /64."""
    return _counted(text) if len(text) <= LONGEST else NO_ADDRESS
