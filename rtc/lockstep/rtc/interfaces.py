"""The addresses of this machine, which peers may be told."""

import ipaddress

import ifaddr

__all__ = ["own_addresses"]

MAX_ADDRESSES = 16  # each costs a socket and as many checks as the peer has candidates


def own_addresses() -> list[str]:
    """Return all addresses but loopback and link-local ones (RFC 8445 5.1.1.1), IPv4 before IPv6; at most 16."""
    found: dict[str, None] = {}
    for adapter in ifaddr.get_adapters():
        for each in adapter.ips:
            address = ipaddress.ip_address(each.ip if isinstance(each.ip, str) else each.ip[0])
            if not (address.is_loopback or address.is_link_local or address.is_unspecified):
                found[str(address)] = None
    return sorted(found, key=lambda host: ":" in host)[:MAX_ADDRESSES]
