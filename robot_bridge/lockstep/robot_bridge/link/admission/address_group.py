"""Which addresses count as one client, for bounds by address. No I/O."""

import ipaddress
from functools import lru_cache

__all__ = ["address_group"]

PREFIX = 64  # bits of an IPv6 address that one customer has; the same customer has all addresses with them


@lru_cache(maxsize=4096)
def address_group(address: str) -> str | None:
    """Return the group that counts as one client: an IPv4 address, or the /64 of an IPv6 address, whatever its scope.

    None: the text is no address. Keep it short: texts are cached.
    """
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return None
    if isinstance(parsed, ipaddress.IPv4Address):
        return str(parsed)
    if parsed.ipv4_mapped is not None:
        return str(parsed.ipv4_mapped)
    return str(ipaddress.ip_network((parsed, PREFIX), strict=False))
