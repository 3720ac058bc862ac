"""Brings the session into the relays while somebody watches there, and tells observers where to watch."""

import asyncio
import secrets
import time
from collections.abc import Callable, Iterable
from typing import Protocol

import structlog

from lockstep.protocol.console import encode_console_message
from lockstep.protocol.messages import Pong
from lockstep.server.auth.tokens import Identity
from lockstep.server.media.errors import MediaError
from lockstep.server.sfu.assignment import Assignment
from lockstep.server.sfu.errors import RelayError
from lockstep.server.sfu.key_holders import KeyHolders
from lockstep.server.sfu.publication import NEW_EPOCH, Engine, Publication
from lockstep.server.sfu.settings import RelaySettings
from lockstep.server.sfu.sfu_server import SfuServer
from lockstep.server.sfu.sfu_servers import SfuServers
from lockstep.server.sfu.tickets import RelayTicket
from lockstep.server.util.backoff import Backoff
from lockstep.server.util.uncancelled import attempt

__all__ = ["SfuCoordinator", "RelayedPeer"]

log = structlog.get_logger(__name__)

WAIT_SECONDS = 3.0  # an observer waits this long for a relay before the console serves it directly
LINGER_SECONDS = 20.0  # the session stays in the relays this long without an observer there
HEARTBEAT_SECONDS = 0.4  # between two messages on the feedback channel, also while the robot link is down
BACKOFF, BACKOFF_CAP = 0.1, 2.0  # s
HEALTHY_SECONDS = 10.0
LOOK_SECONDS = 0.25  # between two checks that the observers may still watch
ENDED, UNWATCHED, STRAY = "a link ended", "nobody watches", "an observer left with a key"
OWN_REASONS = (NEW_EPOCH, ENDED, UNWATCHED, STRAY)  # reasons of the console to end a publication; no fault of a relay
HEARTBEAT = encode_console_message(Pong(id=0))


class RelayedPeer(Protocol):
    """The part of a peer that the coordinator needs."""

    @property
    def relay(self) -> str: ...
    @property
    def role(self) -> str: ...
    @property
    def identity(self) -> Identity: ...


class SfuCoordinator:
    """Run `run` as a task. Everything else is called on the same loop and returns at once, except `ticket`."""

    def __init__(
        self,
        settings: RelaySettings,
        engine: Engine,
        peers: Iterable[RelayedPeer],
        has_ended: Callable[[str, float], bool],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`has_ended` returns whether the link with this id and expiry is no longer valid."""
        servers = [
            SfuServer(str(number), url, settings.relay_public[number] if settings.relay_public else url.address)
            for number, url in enumerate(settings.relay_urls)
        ]
        self.servers = SfuServers(servers, clock)
        self._engine = engine
        self._peers = peers
        self._holders = KeyHolders(has_ended)
        self._clock = clock
        self._handout = Assignment(settings.observers_direct)
        self._publication: Publication | None = None
        self._wanted = asyncio.Event()
        self._asked_at = float("-inf")  # last request for a relay

    # From the console

    def send_feedback(self, text: str) -> None:
        """Send feedback to all observers behind relays at once, as one receiver among the observers."""
        if self._publication is not None:
            self._publication.send_feedback(text)

    # Requests of observers

    async def ticket(self, peer: RelayedPeer | None, lost: str) -> RelayTicket | None:
        """Return a ticket to the relay for one more observer; None: the console. It holds a key, see `key`.

        Args:
            peer: the observer, if it asks again because its relay is gone
            lost: the "RELAY-FEED" that it lost, which is not given out again
        """
        now = self._clock()
        direct = sum(not each.relay and each.role == "observer" for each in self._peers)
        if not self.servers or (peer is None and not self._handout.full(now, direct)):
            self._handout.choose(now, direct, {})
            return None
        self._asked_at = now
        self._wanted.set()
        usable = await self.servers.usable(lost, WAIT_SECONDS)
        watching = {station.name: 0 for station in usable}
        for each in self._peers:
            if each.relay in watching and each is not peer:
                watching[each.relay] += 1
        choice = self._handout.choose(now, direct, watching)
        station = next((each for each in usable if each.name == choice), None)
        return None if station is None else self._engine.ticket(station)

    def key(self, peer: RelayedPeer) -> RelayTicket | None:
        """Return the ticket that lets `peer` into its relay; None if that does not carry the session now.

        The link of `peer` is remembered: when the link ends, the key becomes invalid.
        """
        station = self.servers.by_name(peer.relay)
        if station is None or not station.live:
            return None
        self._holders.add(peer.identity, self._clock())
        return self._engine.ticket(station)

    def arrived(self, relay: str) -> bool:
        """Note that a peer which watches through `relay` has connected. Return False if there is no such relay."""
        self._handout.arrived(relay)
        return self.servers.by_name(relay) is not None

    # The task

    async def run(self) -> None:
        """Run until cancelled; return at once without relays."""
        backoff = Backoff(BACKOFF, BACKOFF_CAP)
        while self.servers:
            await self._wanted.wait()
            if not self._in_demand():
                self._wanted.clear()
                continue
            began = self._clock()
            origin = self.servers.first_to_try()
            try:
                await attempt(self._carry(origin))
            except (RelayError, MediaError, OSError, ConnectionError) as error:
                self.servers.failed(origin, str(error))
            except Exception as error:
                # A fault of the console itself; a relay never ends the console.
                log.exception("publishing failed", relay=origin.url.address)
                self.servers.failed(origin, type(error).__name__)
            if self._clock() - began > HEALTHY_SECONDS:
                backoff.healthy()
            await asyncio.sleep(backoff.next())

    def _in_demand(self) -> bool:
        now = self._clock()
        waiting = now - self._asked_at < WAIT_SECONDS or self._handout.expected(now)
        return waiting or any(each.relay for each in self._peers)

    async def _carry(self, origin: SfuServer) -> None:
        """Publish to one relay, and from there to the others; return when that has ended or nobody watches."""
        async with self._engine.publish(origin, secrets.randbits(52) | 1) as publication:
            self._publication = publication
            self._holders.begin(self._clock())
            if not publication.ended.is_set():  # an epoch may have begun during the negotiation
                self.servers.carries(origin, publication)
            try:
                await self._while_wanted(publication, origin)
            finally:
                self._publication = None
                for station in self.servers:
                    self.servers.gone(station, publication.why)
        if publication.why in OWN_REASONS:
            log.info("the session is no longer published", relay=origin.url.address, why=publication.why)
        else:
            self.servers.failed(origin, publication.why)

    async def _while_wanted(self, publication: Publication, origin: SfuServer) -> None:
        """Return when the publication has ended. A fault in one of the tasks ends it too."""
        async with asyncio.TaskGroup() as tasks:
            running = [
                tasks.create_task(self._extend(origin, station, publication), name=f"relay {station.name}")
                for station in self.servers
                if station is not origin
            ]
            running += [tasks.create_task(self._watch(publication)), tasks.create_task(self._beat(publication))]
            await publication.ended.wait()
            for task in running:
                task.cancel()

    async def _watch(self, publication: Publication) -> None:
        """End the publication when nobody watches, or a holder of its key may no longer watch."""
        quiet_since = self._clock()
        while True:
            await asyncio.sleep(LOOK_SECONDS)
            if self._holders.any_has_ended():
                publication.end(ENDED)
            if self._holders.has_strays({each.identity.token_id for each in self._peers if each.relay}, self._clock()):
                publication.end(STRAY)
            if self._in_demand():
                quiet_since = self._clock()
            elif self._clock() - quiet_since > LINGER_SECONDS:
                self._wanted.clear()
                publication.end(UNWATCHED)

    async def _beat(self, publication: Publication) -> None:
        """Send heartbeats, so that observers can tell a relay that hangs from a robot that is silent."""
        while True:
            await asyncio.sleep(HEARTBEAT_SECONDS)
            publication.send_feedback(HEARTBEAT)

    async def _extend(self, origin: SfuServer, station: SfuServer, publication: Publication) -> None:
        """Keep one more relay fed from the first, until cancelled."""
        backoff = Backoff(BACKOFF, BACKOFF_CAP)
        while True:
            began = self._clock()
            try:
                await attempt(self._feed(origin, station, publication))
            except RelayError as error:
                self.servers.failed(station, str(error))
            except Exception as error:
                # A fault of the console itself; one more relay never ends the others.
                log.exception("passing on to a relay failed", relay=station.url.address)
                self.servers.failed(station, type(error).__name__)
            finally:
                self.servers.gone(station, "")
            if self._clock() - began > HEALTHY_SECONDS:
                backoff.healthy()
            await asyncio.sleep(backoff.next())

    async def _feed(self, origin: SfuServer, station: SfuServer, publication: Publication) -> None:
        async with self._engine.pass_on(origin, station, publication) as link:
            self.servers.carries(station, publication)
            await link.ended.wait()
            self.servers.failed(station, link.why)
