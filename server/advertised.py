"""Candidates at the outer addresses of a machine behind one-to-one NAT. No I/O.

Such a machine, as most in a cloud, knows only its inner addresses; nobody outside reaches them. The NAT changes nothing
but the address (RFC 2663 4.1.1), so each inner candidate is offered a second time with each outer address.
"""

import ipaddress
from collections.abc import Sequence
from hashlib import sha256

__all__ = ["advertised_candidates", "with_advertised"]

HOST_PREFERENCE = 126  # RFC 8445 5.1.2.2
FIELDS = 8  # candidate:FOUNDATION COMPONENT TRANSPORT PRIORITY ADDRESS PORT typ TYPE


def with_advertised(sdp: str, addresses: Sequence[str]) -> str:
    """`sdp` of ours, with the outer candidates after each inner one."""
    if not addresses:
        return sdp
    lines = []
    for line in sdp.splitlines():
        lines.append(line)
        if line.startswith("a=candidate:"):
            lines += [f"a={each}" for each in advertised_candidates(line[2:], addresses)]
    return "\r\n".join(lines) + "\r\n"


def advertised_candidates(candidate: str, addresses: Sequence[str]) -> list[str]:
    """The outer candidates for an inner one, "candidate:…": one for each of `addresses` of its family.

    Empty for what is no host candidate, and for loopback, where no NAT leads.
    """
    words = candidate.split()
    if len(words) < FIELDS or words[7] != "host":
        return []
    component, inner = words[1], ipaddress.ip_address(words[4])
    if inner.is_loopback:
        return []
    outer = [address for address in addresses if ipaddress.ip_address(address).version == inner.version]
    made = []
    for place, address in enumerate(outer, 1):
        # One foundation for each pair of addresses (RFC 8445 5.1.1.3), of at most 32 letters and digits.
        foundation = sha256(f"{address} {inner}".encode()).hexdigest()[:32]
        priority = (HOST_PREFERENCE << 24) + ((65535 - len(outer) - place) << 8) + 256 - int(component)
        made.append(" ".join([f"candidate:{foundation}", *words[1:3], str(priority), address, *words[5:]]))
    return made
