"""Gathers candidates: of bound sockets, of a 1:1 NAT in front of them, and from STUN and TURN servers."""

import ipaddress
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from lockstep.rtc.addresses import Address, Transport
from lockstep.rtc.ice.candidates import Candidate, CandidateType, TcpType, candidate_priority, foundation
from lockstep.rtc.ice.check_list import LocalCandidate

__all__ = ["Advertised", "AdvertisedError", "gather", "parse_advertised", "reflexive", "relayed"]


class AdvertisedError(ValueError):
    """The text is not `outer` or `outer=inner` of two IP addresses of one version."""


@dataclass(frozen=True, slots=True)
class Advertised:
    """An address at which a NAT forwards every port to this machine, as for cloud machines and container networks."""

    outer: str
    inner: str | None = None  # the local address behind it; None: the first of its IP version that is not loopback


def parse_advertised(text: str) -> Advertised:
    """Return the addresses in `203.0.113.7` or `203.0.113.7=10.0.0.5`.

    Raises:
        AdvertisedError: the text has neither form.
    """
    try:
        addresses = [ipaddress.ip_address(each.strip()) for each in text.split("=")]
    except ValueError as error:
        raise AdvertisedError(f"not an IP address: {text[:80]!r}") from error
    if len(addresses) > 2 or addresses[0].version != addresses[-1].version:
        raise AdvertisedError(f"not outer=inner of one IP version: {text[:80]!r}")
    return Advertised(str(addresses[0]), str(addresses[1]) if len(addresses) == 2 else None)


def gather(
    hosts: Sequence[str], port: int, tcp_port: int | None = None, advertised: Iterable[Advertised] = ()
) -> list[LocalCandidate]:
    """Return candidates for a UDP socket that is reached at `port` on all `hosts`, the preferred ones first.

    Args:
        hosts: IP addresses of this machine.
        tcp_port: The port on which TCP connections are accepted as well (RFC 6544, passive); None: no port.
    """
    hosts = [str(ipaddress.ip_address(host)) for host in hosts]
    found: list[LocalCandidate] = []
    for place, host in enumerate(hosts):
        preference = 65535 - place  # RFC 8445 5.1.2.1: a different one for each address
        found.append(_local("host", (host, port), (host, port), preference))
        if tcp_port is not None:
            found.append(_local("host", (host, tcp_port), (host, tcp_port), 8191 - place, "passive"))
    for place, each in enumerate(advertised):
        inner = each.inner or _first_of_version(hosts, each.outer)
        if inner not in hosts:
            continue  # no local address is behind it
        preference = 65535 - place
        found.append(_local("srflx", (each.outer, port), (inner, port), preference))
        if tcp_port is not None:
            found.append(_local("srflx", (each.outer, tcp_port), (inner, tcp_port), 8191 - place, "passive"))
    return found


def reflexive(mapped: Address, base: Address, place: int) -> LocalCandidate:
    """Return the mapped address of the socket at `base`, from a STUN server; a lower `place` is preferred."""
    return _local("srflx", mapped, base, 65535 - place)


def relayed(address: Address, mapped: Address | None, place: int) -> LocalCandidate:
    """Return an address on a TURN server, which is its own base (RFC 8445 5.1.1.2)."""
    return _local("relay", address, address, 65535 - place, related=mapped)


def _local(
    kind: CandidateType,
    address: Address,
    base: Address,
    preference: int,
    tcp_type: TcpType | None = None,
    *,
    related: Address | None = None,
) -> LocalCandidate:
    transport: Transport = "udp" if tcp_type is None else "tcp"
    candidate = Candidate(
        foundation=foundation(kind, base[0], transport),
        component=1,
        transport=transport,
        priority=candidate_priority(kind, preference, tcp_type),
        host=address[0],
        port=address[1],
        type=kind,
        related=None if kind == "host" else related or base,
        tcp_type=tcp_type,
    )
    return LocalCandidate(candidate, base)


def _first_of_version(hosts: Sequence[str], outer: str) -> str | None:
    version = ipaddress.ip_address(outer).version
    addresses = [ipaddress.ip_address(host) for host in hosts]
    return next((str(each) for each in addresses if each.version == version and not each.is_loopback), None)
