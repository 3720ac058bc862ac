"""Checks the names of a fleet's robots, and parses "NAME=address". No I/O."""

import re
from collections.abc import Iterable
from typing import NamedTuple

__all__ = ["NAME_PATTERN", "BadFleet", "NamedRobot", "check_names", "check_robot_name", "is_named", "parse_robots"]

MAX_ROBOTS = 64
NAME_PATTERN = r"[a-z0-9][a-z0-9-]{0,31}"
_NAME = re.compile(NAME_PATTERN)


class BadFleet(ValueError):
    """The robots of a fleet are named wrongly.

    Attributes:
        name: stable, as in "bad_robot_name"
        detail: for a person
    """

    def __init__(self, name: str, detail: str) -> None:
        super().__init__(name, detail)
        self.name = name
        self.detail = detail

    def __str__(self) -> str:
        return f"{self.name}: {self.detail}"


class NamedRobot(NamedTuple):
    name: str
    address: str  # "tcp://10.0.0.5:5600"


def check_robot_name(name: str) -> str:
    """Return `name` as it is. It stands in paths, in file names and in links, so it has to be plain.

    Raises:
        BadFleet: bad_robot_name.
    """
    if _NAME.fullmatch(name) is None:
        raise BadFleet(
            "bad_robot_name",
            f"{name[:40]!r}: a robot's name has 1 to 32 of a-z, 0-9 and -, and does not begin with -",
        )
    return name


def is_named(text: str) -> bool:
    """True for NAME=address, False for an address alone; an address has no = before its ://."""
    return "=" in text.partition("://")[0]


def check_names(names: Iterable[str]) -> None:
    """Check all names. Raises BadFleet: bad_robot_name, robot_named_twice, too_many_robots."""
    seen: set[str] = set()
    for name in names:
        if check_robot_name(name) in seen:
            raise BadFleet("robot_named_twice", f"there are two robots called {name!r}")
        seen.add(name)
    if len(seen) > MAX_ROBOTS:
        raise BadFleet("too_many_robots", f"{len(seen)} robots; one console takes at most {MAX_ROBOTS}")


def parse_robots(texts: Iterable[str]) -> list[NamedRobot]:
    """Parse robots given as NAME=address. Addresses are not checked.

    Raises:
        BadFleet: bad_robot_name, robot_named_twice, too_many_robots, robot_without_name.
    """
    found = []
    for text in texts:
        if not is_named(text):
            raise BadFleet("robot_without_name", f"{text!r}: with several robots each has a name, NAME=tcp://host:port")
        name, _, address = text.partition("=")
        found.append(NamedRobot(name.strip(), address.strip()))
    check_names(each.name for each in found)
    return found
