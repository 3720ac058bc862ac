"""What all robots of one console have in common: who may come in, how often anybody may ask, and how many fit."""

import asyncio
import time
from typing import Protocol

from prometheus_client import Counter

from server.access import Identity
from server.audit import Actor
from server.errors import TooManyPeers
from server.faults import Faults
from server.guard import Guard
from server.invitations import Invitation
from server.link_warden import LinkWarden
from server.state import ConsoleState

__all__ = ["House", "HouseMetrics"]

COMMAND_LINE = Actor("command line")
CHECK_SECONDS = 1.0  # how long a link that was revoked by another process still works


class HouseMetrics(Protocol):
    """Where it counts what concerns no robot."""

    @property
    def bad_input(self) -> Counter: ...
    @property
    def faults(self) -> Faults: ...


class House:
    """Every robot's session brings its warden. Run `run` as a task; call `enforce` after inviting or revoking here.

    Args:
        max_peers: of all robots together; None: each robot's own bound is all there is
        reserved: of those, that observers do not get
    """

    def __init__(
        self,
        state: ConsoleState,
        guard: Guard,
        metrics: HouseMetrics,
        max_peers: int | None = None,
        reserved: int = 0,
    ) -> None:
        self.state = state
        self.guard = guard
        self.metrics = metrics
        self.wardens: list[LinkWarden] = []
        self._max_peers = max_peers
        self._reserved = reserved

    async def run(self) -> None:
        """Until cancelled: act on what other processes have changed about the links."""
        while True:
            await asyncio.sleep(CHECK_SECONDS)
            try:
                self.enforce(self.state.invitations.refresh(), COMMAND_LINE)
            except Exception as error:
                self.metrics.faults.caught("links", error)

    def enforce(self, changed: list[Invitation], by: Actor) -> None:
        """Act, at every robot, on what `by` has invited or revoked, and on what has expired."""
        now = time.time()
        for warden in self.wardens:
            warden.enforce(changed, by, now)

    def connected(self, link: str) -> int:
        """Peers that are here with the link of this id, at any robot."""
        return sum(warden.connected(link) for warden in self.wardens)

    def check_room(self, identity: Identity) -> None:
        """Raises TooManyPeers when there is no place for another peer at any robot."""
        if self._max_peers is None:
            return
        bound = self._max_peers
        if identity.role == "observer":
            bound = max(1, bound - self._reserved)
        if sum(warden.peers.taken for warden in self.wardens) >= bound:
            raise TooManyPeers(f"all {bound} places of this console are taken")
