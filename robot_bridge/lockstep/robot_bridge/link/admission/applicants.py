"""Bounds the connections that wait to be admitted, and chooses which of them is ended. No I/O, no clock."""

from collections import Counter
from typing import Generic, TypeVar

from lockstep.robot_bridge.link.admission.address_group import address_group

__all__ = ["Applicants", "Strangers"]

Applicant = TypeVar("Applicant")


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
        self._groups[applicant] = address_group(address) or address
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
