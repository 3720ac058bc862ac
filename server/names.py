"""What people call themselves: only what can be printed, of bounded length, and never two the same."""

from collections.abc import Sequence
from enum import IntEnum

__all__ = ["MAX_NAME", "clean_name", "printable", "unique_names"]

MAX_NAME = 40  # characters


def printable(text: str) -> str:
    """`text` without control, formatting and direction characters; any white space becomes one space."""
    return " ".join("".join(each if each.isprintable() else " " if each.isspace() else "" for each in text).split())


def clean_name(wanted: str, fallback: str) -> str:
    """`wanted` as others may see it; `fallback` when nothing of it is left."""
    return printable(wanted)[:MAX_NAME].strip() or fallback


def unique_names(people: Sequence[tuple[str, str]]) -> list[str]:
    """What each of `people` is called, so that no two are called the same.

    Each is given by the name that is wanted and the one that others see now, "" for a newcomer, in the order in which
    they came. Nobody takes a name from who has it, and a number behind a name stays until the name itself is free.
    """
    taken: set[str] = set()
    numbers: dict[str, int] = {}  # last one given for a name; a crowd of one name costs no more than others
    names = [""] * len(people)
    for place in sorted(range(len(people)), key=lambda each: _claim(*people[each])):
        wanted, current = people[place]
        name = wanted
        if name.casefold() in taken and _claim(wanted, current) is _Claim.NUMBERED:
            name = current
        while name.casefold() in taken:
            number = numbers[wanted.casefold()] = numbers.get(wanted.casefold(), 1) + 1
            name = f"{wanted} {number}"
        taken.add(name.casefold())
        names[place] = name
    return names


class _Claim(IntEnum):
    """Who comes first."""

    HAS_IT = 0
    NUMBERED = 1  # has it with a number
    WANTS_IT = 2


def _claim(wanted: str, current: str) -> _Claim:
    if current.casefold() == wanted.casefold():
        return _Claim.HAS_IT
    name, _, number = current.rpartition(" ")
    return _Claim.NUMBERED if name.casefold() == wanted.casefold() and number.isdecimal() else _Claim.WANTS_IT
