"""The summary of one robot of a fleet, for other consoles and `GET /api/fleet`."""

from dataclasses import dataclass, replace
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field

from lockstep.protocol.console import Role

__all__ = ["MAX_PEOPLE", "ROBOT_NAME", "Person", "Tile", "loud", "within_bounds"]

ROBOT_NAME = r"^[a-z0-9][a-z0-9-]{0,31}$"  # for pydantic; with `re`, use fullmatch
MAX_PEOPLE = 20  # people that a tile names; the others are counted
MAX_FAULTS = 20

Name = Annotated[str, Field(max_length=60)]
Words = Annotated[str, Field(max_length=500)]
Count = Annotated[int, Field(ge=0, le=1_000_000)]
Number = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Event = Annotated[int, Field(ge=0, lt=2**31)]


def _check_url(url: str) -> str:
    """Accept only addresses that a page may offer as a link: never a script, never somebody's password."""
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.hostname or "@" in parts.netloc:
        raise ValueError("not http(s)://host/…")
    return url


@dataclass(frozen=True, kw_only=True)
class Person:
    name: Name
    role: Role
    driving: bool = False


@dataclass(frozen=True, kw_only=True)
class Tile:
    """A robot's summary, the same for every reader. Tiles from other consoles are checked against these bounds."""

    name: Annotated[str, Field(pattern=ROBOT_NAME)]  # "left"
    label: Name  # of the robot's description; "" before it was reached
    url: Annotated[str, Field(max_length=300), AfterValidator(_check_url)]  # own robots': "robots/left/"
    link: Literal["up", "down", "unknown"]  # unknown: its console is not heard; only of other consoles' robots
    detail: Words = ""  # reason that it is down
    link_age_ms: Number | None = None  # age of the link's state; None: the link was never up
    epoch: Annotated[str, Field(max_length=64)] = ""
    event: Event = 0  # 0 before the first feedback
    event_rate: Number = 0.0  # events a second, over the last few seconds
    stopped: bool = False
    stop_by: Words = ""
    stop_reason: Words = ""
    at_rest: bool = True
    driver: Name = ""  # holder of the seat; "": nobody
    claims: Annotated[tuple[Name, ...], Field(max_length=MAX_PEOPLE)] = ()  # people who ask for the seat
    participants: Annotated[tuple[Person, ...], Field(max_length=MAX_PEOPLE)] = ()  # the driver first
    participant_count: Count = 0
    watching: Count = 0  # thumbnails
    feedback_age_ms: Number | None = None  # None: never had one
    gap: Annotated[int, Field(ge=-(2**31), lt=2**31)] | None = None  # as the driver's page saw it last
    tolerance: Count | None = None
    recording: bool = False
    faults: Annotated[tuple[Words, ...], Field(max_length=MAX_FAULTS)] = ()
    trouble: Words = ""
    has_picture: bool = False
    console: Name = ""  # name of the console that has it; "": this one


def within_bounds(tile: Tile, public_url: str) -> Tile:
    """Return a tile as others take it: nothing longer than they read, and an address that leads here from anywhere."""
    return replace(
        tile,
        label=tile.label[:60],
        url=tile.url if "://" in tile.url else f"{public_url}/{tile.url}",
        detail=tile.detail[:500],
        stop_by=tile.stop_by[:500],
        stop_reason=tile.stop_reason[:500],
        driver=tile.driver[:60],
        claims=tuple(name[:60] for name in tile.claims[:MAX_PEOPLE]),
        participants=tuple(replace(each, name=each.name[:60]) for each in tile.participants[:MAX_PEOPLE]),
        faults=tuple(fault[:500] for fault in tile.faults[:MAX_FAULTS]),
        trouble=tile.trouble[:500],
        console="",
    )


def loud(tile: Tile) -> tuple[object, ...]:
    """Return the values that others should know at once; the rest can wait for a second."""
    return (
        tile.name, tile.link, tile.epoch, tile.stopped, tile.driver, tile.claims, tile.participants,
        tile.participant_count, tile.recording, tile.faults, tile.trouble,
    )  # fmt: skip
