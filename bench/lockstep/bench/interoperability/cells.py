"""The table of clients and ways: the cells to run, the time for each, and the results so far. No I/O.

A way is the route of a client's datagrams to the console. A client that cannot take a way has no cell there.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, get_args

import msgspec

from lockstep.bench.interoperability.names import Client, Way

__all__ = ["CELLS", "Cell", "Found", "seconds_of", "table_of", "wanted"]

LONG_SECONDS, SHORT_SECONDS = 1200.0, 60.0
LEAST_PICTURES = 2.0  # a second, of the first camera

# Plain aiortc has no ICE-TCP; the examples for it and for GStreamer's webrtcbin have no TURN server. A Janus stands at
# the robot's side, so that only what is between it and the console counts.
WITHOUT: Mapping[Way, frozenset[Client]] = {
    "udp": frozenset(),
    "tcp": frozenset({"aiortc", "headless", "janus"}),
    "turn": frozenset({"aiortc", "gstreamer", "janus"}),
    "nat": frozenset({"janus"}),
    "ipv6": frozenset({"janus"}),
    "far": frozenset({"janus"}),
    "two": frozenset(),
}


class Cell(NamedTuple):
    client: Client
    way: Way

    def __str__(self) -> str:
        return f"{self.client} {self.way}"


class Found(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one run of a cell."""

    seconds: float
    pictures: int = 0
    events: int = 0  # events that the client heard of
    violations: int = 0  # pictures and sounds rendered beyond the tolerance; 0 if the client cannot tell
    reconnections: int = 0
    trouble: str = ""  # why the run did not come to its end
    commit: str = ""

    @property
    def verdict(self) -> str:
        """The verdict: "ok", or the fault."""
        if self.trouble:
            return self.trouble
        if self.pictures < LEAST_PICTURES * self.seconds:
            return f"only {self.pictures} pictures"
        if self.events < 1:
            return "no feedback"
        if self.violations:
            return f"{self.violations} beyond the tolerance"
        return f"{self.reconnections} reconnections" if self.reconnections else "ok"


CELLS = tuple(Cell(client, way) for way in get_args(Way) for client in get_args(Client) if client not in WITHOUT[way])


def seconds_of(cell: Cell, scale: float = 1.0) -> float:
    """Return the time of a run: 20 minutes over UDP, one over each other way; `scale` multiplies all of them."""
    return scale * (LONG_SECONDS if cell.way == "udp" else SHORT_SECONDS)


def wanted(
    known: Mapping[str, Found], *, clients: Iterable[str] = (), ways: Iterable[str] = (), again: bool = False
) -> list[Cell]:
    """Return the cells that are still to be run: those that are not "ok" yet, of these clients and ways (empty: all).

    `again`: also those that are "ok".
    """
    chosen, along = set(clients), set(ways)
    return [
        cell
        for cell in CELLS
        if (not chosen or cell.client in chosen)
        and (not along or cell.way in along)
        and (again or str(cell) not in known or known[str(cell)].verdict != "ok")
    ]


def table_of(known: Mapping[str, Found]) -> str:
    """Return the table in Markdown: a row for each client, a column for each way."""
    ways = get_args(Way)
    lines = ["| client | " + " | ".join(ways) + " |", "|---|" + "---|" * len(ways)]
    for client in get_args(Client):
        row: list[Any] = [client]
        for way in ways:
            if client in WITHOUT[way]:
                row.append("–")
            elif (found := known.get(f"{client} {way}")) is None:
                row.append("not run")
            else:
                row.append(f"{found.verdict} ({found.seconds:g} s, {found.pictures} pictures)")
        lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines)
