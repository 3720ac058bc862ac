"""The context that all robots of one console share: links, request rates, and the bound on peers."""

import asyncio
import time
from collections import Counter
from collections.abc import Mapping
from typing import Protocol

import structlog
from prometheus_client import Counter as Metric

from lockstep.server.audit.records import Actor
from lockstep.server.auth.invitations import Invitation
from lockstep.server.auth.silenced_links import SilencedLinks
from lockstep.server.auth.tokens import Identity
from lockstep.server.http.request_rate_limits import RequestRateLimits
from lockstep.server.peers.peer_places import check_place
from lockstep.server.peers.token_revocation import TokenRevocation
from lockstep.server.state.persistent_state import ConsoleState
from lockstep.server.telemetry.faults import Faults
from lockstep.server.util.state_dir import StateDirUnusable
from lockstep.server.util.uncancelled import in_thread
from lockstep.server.webrtc.media_endpoint import MediaEndpoint

__all__ = ["ConsoleContext", "ContextMetrics"]

log = structlog.get_logger(__name__)

COMMAND_LINE = Actor("command line")
CONSOLE = Actor("console")
CHECK_SECONDS = 0.5  # s for which a link that expired, or was revoked by another process, still works at most
RETRY_SECONDS = 5.0  # until a write that the disk did not take is tried again
KEEP_SECONDS = 60.0  # between two writes of the time


class ContextMetrics(Protocol):
    """The metrics for all that concerns no robot."""

    @property
    def bad_input(self) -> Metric: ...
    @property
    def faults(self) -> Faults: ...


class ConsoleContext:
    """The context of one console. Every robot's session adds its token revocation to `revocations`.

    Run `run` as a task; call `enforce` after inviting or revoking here.

    Args:
        max_peers: of all robots together; None: only each robot's own bound applies
        reserved: places among those that observers do not get
    """

    def __init__(
        self,
        state: ConsoleState,
        request_limits: RequestRateLimits,
        metrics: ContextMetrics,
        endpoint: MediaEndpoint,
        max_peers: int | None = None,
        reserved: int = 0,
    ) -> None:
        self.endpoint = endpoint
        self._dropped: Counter[str] = Counter()  # datagrams that are in the metrics
        self.state = state
        self.request_limits = request_limits
        self.metrics = metrics
        self.revocations: list[TokenRevocation] = []
        self.silenced = SilencedLinks(state.invitations.invited_with)
        self._max_peers = max_peers
        self._reserved = reserved

    async def run(self) -> None:
        """Act on links that other processes change, and on links that expire, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._look_on(), name="links end")
            tasks.create_task(self._keep_time(), name="newest time")  # a hanging disk must not delay the end of a link
            tasks.create_task(self._keep_ended(), name="revocations")

    def close(self) -> None:
        """Close the media endpoint, after all sessions have ended."""
        self.endpoint.close()

    def collect(self) -> None:
        """Update the metrics with counts that are kept elsewhere."""
        dropped = self.endpoint.dropped
        for name, count in (dropped - self._dropped).items():
            self.metrics.bad_input.labels("transport", name).inc(count)
        self._dropped = dropped

    async def _look_on(self) -> None:
        while True:
            await asyncio.sleep(CHECK_SECONDS)
            try:
                self._end_silences()
                self.enforce(self.state.invitations.refresh(), COMMAND_LINE)
            except Exception as error:
                self.metrics.faults.caught("links", error)

    async def _keep_time(self) -> None:
        """Write down the time once in a while, and whenever a link has expired."""
        store, loop = self.state.invitations, asyncio.get_running_loop()
        looked = store.clock.now()
        keep_at = loop.time()
        while True:
            await asyncio.sleep(CHECK_SECONDS)
            try:
                now = store.clock.now()
                expired = any(looked < each.expires <= now for each in store.known.all)
                looked = now
                if expired or loop.time() >= keep_at:
                    keep_at = loop.time() + KEEP_SECONDS
                    await in_thread(store.keep_time)
            except StateDirUnusable as error:
                log.error("the time cannot be written to the state directory", detail=str(error))
            except Exception as error:
                self.metrics.faults.caught("links", error)

    async def _keep_ended(self) -> None:
        """Write revocations that the disk did not take, as soon as it does."""
        store = self.state.invitations
        while True:
            await asyncio.sleep(RETRY_SECONDS)
            if not store.unwritten:
                continue
            try:
                self.enforce(await in_thread(store.keep_ended), CONSOLE)
            except StateDirUnusable as error:
                log.error("revocations cannot be written to the state directory", detail=str(error))
            except Exception as error:
                self.metrics.faults.caught("links", error)

    def enforce(self, changed: list[Invitation], by: Actor) -> None:
        """Act, at every robot, on links that `by` has invited or revoked, and on links that have expired."""
        now = self.state.invitations.clock.now()
        for revocation in self.revocations:
            revocation.enforce(changed, by, now)

    def connected(self) -> Counter[str]:
        """Count the connected peers of all robots, by the ids of their links."""
        return Counter(peer.identity.token_id for revocation in self.revocations for peer in revocation.peers)

    # silence

    def is_silenced(self, link: str) -> bool:
        """True if a supervisor has silenced the stops of this link, or of one that it was invited with."""
        return self.silenced.holds(link, time.monotonic())

    def silences(self) -> dict[str, float]:
        """Return the links that other consoles have to silence too, with the ends in s since 1970."""
        now, ahead = time.monotonic(), self.state.invitations.clock.now() - time.monotonic()
        known = [each.id for each in self.state.invitations.known.all]
        return {link: until + ahead for link, until in self.silenced.to_tell(known, now).items()}

    def silenced_elsewhere(self, console: str, links: Mapping[str, float]) -> None:
        """Take another console's `silences`, all that it has now."""
        now, ahead = time.monotonic(), self.state.invitations.clock.now() - time.monotonic()
        self.silenced.told_elsewhere(console, {link: until - ahead for link, until in links.items()}, now)

    def _end_silences(self) -> None:
        for link in self.silenced.ended(time.monotonic()):
            for revocation in self.revocations:
                revocation.silence_ended(link)

    def check_room(self, identity: Identity) -> None:
        """Raise TooManyPeers when there is no place for another peer at any robot."""
        if self._max_peers is None:
            return
        held = sum(revocation.peers.places.taken_by(identity.token_id) for revocation in self.revocations)
        taken = sum(revocation.peers.places.taken for revocation in self.revocations)
        check_place(identity.role, held, taken, self._max_peers, self._reserved)
