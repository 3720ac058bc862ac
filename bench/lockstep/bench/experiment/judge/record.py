"""The record of a run, at the robot and at each client. Times are in s on this machine's monotonic clock. No I/O."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from lockstep.client.control.command_gate import Pacing

__all__ = ["Arrival", "ClientRecord", "Gate", "Rendered", "RobotRecord", "Run", "fresh"]

Gate = Literal["off", "age", "event"]  # "event" is the rule; the others are compared with it


class Arrival(NamedTuple):
    """A feedback at a client, or an event executed at the robot."""

    at: float
    event: int


class Rendered(NamedTuple):
    """A picture or a segment of sound that passed the gate."""

    at: float
    stamp: int | None
    gap: int | None
    feedback: int | None
    age: float | None  # s since its capture


@dataclass
class RobotRecord:
    """The events at the robot, from the bridge's own log."""

    executed: list[Arrival] = field(default_factory=list)
    answered: list[Arrival] = field(default_factory=list)  # the first feedback of each event
    captured: dict[str, list[Arrival]] = field(default_factory=dict)  # by stream


@dataclass
class ClientRecord:
    """A client: its kind, its renderings, its statistics."""

    name: str
    kind: str  # "headless" or "chromium"
    gate: Gate
    pacing: Pacing
    drives: bool
    tolerance: int
    feedbacks: list[Arrival] = field(default_factory=list)
    rendered: dict[str, list[Rendered]] = field(default_factory=dict)  # by stream
    earlier: dict[str, int] = field(default_factory=dict)  # renderings from before the run: the one on screen, or none
    statistics_before: dict[str, Any] = field(default_factory=dict)  # the client's own, when the run begins
    statistics: dict[str, Any] = field(default_factory=dict)  # the client's own, when the run ends
    drawn_right: int = 0  # pictures whose pixels show the event that their stamp says
    drawn_wrong: int = 0
    drawn_unreadable: int = 0
    lost: str = ""  # why the connection ended before the run did

    def since_begin(self, stream: str) -> list[Rendered]:
        """Return the renderings of a stream since the run began."""
        return self.rendered.get(stream, [])[self.earlier.get(stream, 0) :]


@dataclass
class Run:
    """The whole record of one run."""

    began: float
    ended: float
    robot: RobotRecord
    clients: list[ClientRecord]
    cameras: list[str]  # names, the main one first
    microphones: list[str]
    network: dict[str, Any] = field(default_factory=dict)  # the emulator's counts

    @property
    def operator(self) -> ClientRecord:
        return next(client for client in self.clients if client.drives)


def fresh(newest: float, entries: Sequence[Any]) -> list[Any]:
    """Return the entries of a log that came after `newest`: it keeps the last thousand and is read repeatedly."""
    return [entry for entry in entries if entry.at > newest]
