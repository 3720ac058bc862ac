"""The board on which consoles behind one entry share their states. It never moves a robot."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import msgspec

from lockstep.server.audit.records import AuditRecord
from lockstep.server.auth.invitations import Invitation
from lockstep.server.federation.robot_summary import Tile
from lockstep.server.stop.stop_presses import Press

__all__ = ["Board", "BoardHost", "BoardState", "Conflict", "SharedAudit", "SharedRecord", "StopAnswer"]


@dataclass(frozen=True, kw_only=True)
class Conflict:
    """Two living consoles claim the robot of this name."""

    robot: str
    consoles: tuple[str, ...]  # their names
    error: Literal["robot_claimed_twice"] = "robot_claimed_twice"


@dataclass(frozen=True, kw_only=True)
class BoardState:
    shared: bool = False  # True if there may be other consoles at all
    unknown_since: float | None = None  # s since 1970; None: the knowledge of the others is fresh
    detail: str = ""  # the board's trouble, for a person
    conflicts: tuple[Conflict, ...] = ()


class StopAnswer(NamedTuple):
    """The answer of a robot's console to a STOP. `confirmed`: the console answered in time."""

    confirmed: bool
    delivered: bool
    event: int
    detail: str
    number: int = 0  # of the stop; 0 when it was not delivered
    kept: bool = False  # on the robot's disk


class SharedRecord(msgspec.Struct, frozen=True, kw_only=True):
    """A record of some console's audit."""

    console: str  # name of the console; "" is this one
    robot: str
    record: AuditRecord


class SharedAudit(NamedTuple):
    """Records, oldest first. `detail`: the reason that some may be missing."""

    records: list[SharedRecord]
    complete: bool
    detail: str


class BoardHost(Protocol):
    """This console as the board needs it. All is called on the loop and returns at once, except `stop_robot`."""

    async def stop_robot(self, name: str, press: Press) -> StopAnswer:
        """Latch a stop at once; return within a second or so, whether the robot has answered or not."""
        ...

    def silences(self) -> dict[str, float]:
        """Return the links whose stops other consoles have to silence too, with the end in s since 1970."""
        ...

    def silenced_elsewhere(self, console: str, links: Mapping[str, float]) -> None:
        """Take the links that `console` has silenced: all of them, each time."""
        ...

    def links_revoked(self, ended: list[Invitation]) -> None:
        """Note that another console has revoked links; `ended` are this console's invitations that end with them."""
        ...


class Board(Protocol):
    """Run `run` as a task. Methods that are not coroutines are called on the loop and return at once."""

    @property
    def state(self) -> BoardState: ...

    async def run(self) -> None:
        """Run until cancelled."""
        ...

    def publish(self, tiles: Sequence[Tile]) -> None:
        """Show all robots of this console. The newest wins; call it on every change, and once a second."""
        ...

    def others(self) -> list[Tile]:
        """Return the robots of other consoles, except those with a name of this console's robots."""
        ...

    def record(self, robot: str, record: AuditRecord) -> None:
        """Share a record of the audit."""
        ...

    async def audit(self, limit: int) -> SharedAudit:
        """Return the newest `limit` records that consoles have shared."""
        ...

    async def stop(self, robots: Collection[str], press: Press) -> dict[str, StopAnswer]:
        """Stop robots of other consoles; return an answer for every one of `robots` within a few seconds."""
        ...
