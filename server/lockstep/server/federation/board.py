"""The board on which consoles behind one entry tell each other what they do. It never moves a robot."""

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
    """Two living consoles say that they have the robot of this name."""

    robot: str
    consoles: tuple[str, ...]  # their names
    error: Literal["robot_claimed_twice"] = "robot_claimed_twice"


@dataclass(frozen=True, kw_only=True)
class BoardState:
    shared: bool = False  # whether there may be other consoles at all
    unknown_since: float | None = None  # s since 1970; None: what is known of the others is fresh
    detail: str = ""  # what is wrong with the board, for a person
    conflicts: tuple[Conflict, ...] = ()


class StopAnswer(NamedTuple):
    """What the console of a robot said to a STOP. `confirmed`: it said anything in time."""

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
    """Oldest first. `detail`: why it may not be all."""

    records: list[SharedRecord]
    complete: bool
    detail: str


class BoardHost(Protocol):
    """What the board asks of this console. Called on the loop; returns at once, but for `stop_robot`."""

    async def stop_robot(self, name: str, press: Press) -> StopAnswer:
        """Latched at once; returns within a second or so, when the robot has answered or has not."""
        ...

    def silences(self) -> dict[str, float]:
        """Links whose stops other consoles have to silence too, and until when, in s since 1970."""
        ...

    def silenced_elsewhere(self, console: str, links: Mapping[str, float]) -> None:
        """What that console says so of; all of it, each time."""
        ...

    def links_revoked(self, ended: list[Invitation]) -> None:
        """Another console has revoked links; `ended` are invitations of ours that end with them."""
        ...


class Board(Protocol):
    """Run `run` as a task. All that is not awaited is called on the loop and returns at once."""

    @property
    def state(self) -> BoardState: ...

    async def run(self) -> None:
        """Until cancelled."""
        ...

    def publish(self, tiles: Sequence[Tile]) -> None:
        """All robots of this console. The newest wins; call it as often as there is news, and once a second."""
        ...

    def others(self) -> list[Tile]:
        """Robots of the other consoles, without those whose names are ours."""
        ...

    def record(self, robot: str, record: AuditRecord) -> None:
        """Share a record of the audit."""
        ...

    async def audit(self, limit: int) -> SharedAudit:
        """The newest `limit` records that consoles have shared."""
        ...

    async def stop(self, robots: Collection[str], press: Press) -> dict[str, StopAnswer]:
        """STOP for robots of other consoles; every one of `robots` is answered for within a few seconds."""
        ...
