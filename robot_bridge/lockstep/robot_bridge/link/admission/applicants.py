"""Bounds the connections that wait to be admitted, and chooses which of them is ended. No I/O, no clock."""

import ipaddress
from collections import Counter
from typing import Generic, TypeVar

__all__ = ["Applicants", "Strangers", "address_group"]

Applicant = TypeVar("Applicant")
PREFIX = 64  # bits of an IPv6 address that one customer has; the same customer has all addresses with them


def address_group(address: str) -> str:
    """Return the group that counts as one address: an IPv4 address, or the /64 of an IPv6 address."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv4Address):
        return str(parsed)
    if parsed.ipv4_mapped is not None:
        return str(parsed.ipv4_mapped)
    return str(ipaddress.ip_network((parsed, PREFIX), strict=False))


class Applicants(Generic[Applicant]):
    """Connections that wait to be admitted, with their addresses.

    If there are too many, the oldest applicant of the address with the most goes. So an address only ever takes places
    from itself, and a client gets in that is quicker than all places fill.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._groups: dict[Applicant, str] = {}  # oldest first

    def __len__(self) -> int:
        return len(self._groups)

    def __contains__(self, applicant: object) -> bool:
        return applicant in self._groups

    def add(self, applicant: Applicant, address: str) -> Applicant | None:
        """Add an applicant. Return the one that has to go, which is forgotten here; None while there is room."""
        self._groups[applicant] = address_group(address)
        if len(self._groups) <= self._limit:
            return None
        (most, _), *_ = Counter(self._groups.values()).most_common(1)
        oldest = next(each for each, group in self._groups.items() if group == most)
        del self._groups[oldest]
        return oldest

    def remove(self, applicant: Applicant) -> None:
        """Forget an applicant that was admitted or is gone."""
        self._groups.pop(applicant, None)


class Strangers(Generic[Applicant]):
    """Applicants in two stages: silent ones, and those that have said a proper hello and owe the proof.

    Silent ones cannot push out a client that has come further. `silent` and `challenged` return the applicant that has
    to go; None while there is room.
    """

    def __init__(self, limit: int) -> None:
        """`limit`: of each stage."""
        self._silent: Applicants[Applicant] = Applicants(limit)
        self._challenged: Applicants[Applicant] = Applicants(limit)

    def silent(self, applicant: Applicant, address: str) -> Applicant | None:
        """Add an applicant."""
        return self._silent.add(applicant, address)

    def challenged(self, applicant: Applicant, address: str) -> Applicant | None:
        """Move an applicant to the second stage; nothing for one that is there, or was admitted."""
        if applicant not in self._silent:
            return None
        self._silent.remove(applicant)
        return self._challenged.add(applicant, address)

    def forget(self, applicant: Applicant) -> None:
        """Forget an applicant that was admitted or is gone."""
        self._silent.remove(applicant)
        self._challenged.remove(applicant)
