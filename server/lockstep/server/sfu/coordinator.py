"""Brings the session into the relays while somebody watches there, and tells observers where to watch."""

import asyncio
import math
import secrets
import time
from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

import structlog

from lockstep.protocol.console import encode_console_message
from lockstep.protocol.messages import Pong
from lockstep.server.auth.tokens import Identity
from lockstep.server.media.errors import MediaError
from lockstep.server.sfu.assignment import Assignment
from lockstep.server.sfu.errors import RelayError
from lockstep.server.sfu.publication import NEW_EPOCH, Engine, Publication
from lockstep.server.sfu.settings import RelaySettings
from lockstep.server.sfu.sfu_server import SfuServer
from lockstep.server.sfu.tickets import RelayTicket
from lockstep.server.util.backoff import Backoff
from lockstep.server.util.uncancelled import attempt

__all__ = ["SfuCoordinator", "RelayedPeer"]

log = structlog.get_logger(__name__)

WAIT_SECONDS = 3.0  # an observer waits this long for a relay before the console serves it directly
LINGER_SECONDS = 20.0  # the session stays in the relays this long without an observer there
HEARTBEAT_SECONDS = 0.4  # between two messages on the feedback channel, also while the robot link is down
BACKOFF, BACKOFF_CAP = 0.1, 2.0  # s
DISTRUST_SECONDS = 30.0  # a relay that failed is tried after the others for this long
HEALTHY_SECONDS = 10.0
LOOK_SECONDS = 0.25  # between two checks that the observers may still watch
STRAY_SECONDS = 60.0  # then an observer with a key and no line to the console is thought to watch on without it
RENEW_SECONDS = 600.0  # between two publications because of such observers
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


class _Holder(NamedTuple):
    """A link that was given the key of the present publication."""

    expires: float  # s since 1970
    seen_at: float  # last time that one of its peers was here, s on the monotonic clock


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
        self.stations = [
            SfuServer(str(number), url, settings.relay_public[number] if settings.relay_public else url.address)
            for number, url in enumerate(settings.relay_urls)
        ]
        self._engine = engine
        self._peers = peers
        self._has_ended = has_ended
        self._clock = clock
        self._handout = Assignment(settings.observers_direct)
        self._publication: Publication | None = None
        self._wanted = asyncio.Event()
        self._asked_at = float("-inf")  # last request for a relay
        self._changed = asyncio.Event()  # replaced whenever a relay became live or was lost
        self._holders: dict[str, _Holder] = {}  # of the present publication's key, by link
        self._published_at = float("-inf")

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
        if not self.stations or (peer is None and not self._handout.full(now, direct)):
            self._handout.choose(now, direct, {})
            return None
        self._asked_at = now
        self._wanted.set()
        usable = await self._usable(lost)
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
        station = next((each for each in self.stations if each.live and each.name == peer.relay), None)
        if station is None:
            return None
        self._holders[peer.identity.token_id] = _Holder(peer.identity.expires, self._clock())
        return self._engine.ticket(station)

    def arrived(self, relay: str) -> bool:
        """Note that a peer which watches through `relay` has connected. Return False if there is no such relay."""
        self._handout.arrived(relay)
        return any(station.name == relay for station in self.stations)

    async def _usable(self, lost: str) -> list[SfuServer]:
        """Return the relays that carry the session; wait a while for the first."""
        deadline = self._clock() + WAIT_SECONDS
        while True:
            found = [each for each in self.stations if each.live and f"{each.name}-{each.feed}" != lost]
            if found or self._clock() >= deadline:
                return found
            try:
                async with asyncio.timeout(deadline - self._clock()):
                    await self._changed.wait()
            except TimeoutError:
                continue

    # The task

    async def run(self) -> None:
        """Run until cancelled; return at once without relays."""
        backoff = Backoff(BACKOFF, BACKOFF_CAP)
        while self.stations:
            await self._wanted.wait()
            if not self._in_demand():
                self._wanted.clear()
                continue
            began = self._clock()
            origin = min(self.stations, key=self._order)
            try:
                await attempt(self._carry(origin))
            except (RelayError, MediaError, OSError, ConnectionError) as error:
                self._lost(origin, str(error))
            except Exception as error:
                # A fault of the console itself; a relay never ends the console.
                log.exception("publishing failed", relay=origin.url.address)
                self._lost(origin, type(error).__name__)
            if self._clock() - began > HEALTHY_SECONDS:
                backoff.healthy()
            await asyncio.sleep(backoff.next())

    def _order(self, station: SfuServer) -> tuple[float, int]:
        """Sort key: relays that failed lately come last, and the latest failure at the end, as it may be dead."""
        distrusted = self._clock() - station.failed_at < DISTRUST_SECONDS
        return station.failed_at if distrusted else -math.inf, int(station.name)

    def _in_demand(self) -> bool:
        now = self._clock()
        waiting = now - self._asked_at < WAIT_SECONDS or self._handout.expected(now)
        return waiting or any(each.relay for each in self._peers)

    async def _carry(self, origin: SfuServer) -> None:
        """Publish to one relay, and from there to the others; return when that has ended or nobody watches."""
        async with self._engine.publish(origin, secrets.randbits(52) | 1) as publication:
            self._publication = publication
            self._holders.clear()
            self._published_at = self._clock()
            if not publication.ended.is_set():  # an epoch may have begun during the negotiation
                self._live(origin, publication)
            try:
                await self._while_wanted(publication, origin)
            finally:
                self._publication = None
                for station in self.stations:
                    self._gone(station, publication.why)
        if publication.why in OWN_REASONS:
            log.info("the session is no longer published", relay=origin.url.address, why=publication.why)
        else:
            self._lost(origin, publication.why)

    async def _while_wanted(self, publication: Publication, origin: SfuServer) -> None:
        """Return when the publication has ended. A fault in one of the tasks ends it too."""
        async with asyncio.TaskGroup() as tasks:
            running = [
                tasks.create_task(self._extend(origin, station, publication), name=f"relay {station.name}")
                for station in self.stations
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
            if any(self._has_ended(link, each.expires) for link, each in self._holders.items()):
                publication.end(ENDED)
            if self._has_strays():
                publication.end(STRAY)
            if self._in_demand():
                quiet_since = self._clock()
            elif self._clock() - quiet_since > LINGER_SECONDS:
                self._wanted.clear()
                publication.end(UNWATCHED)

    def _has_strays(self) -> bool:
        """Return whether somebody may watch without taking part; False for `RENEW_SECONDS` after a publication."""
        now = self._clock()
        here = {each.identity.token_id for each in self._peers if each.relay}
        for link in here & self._holders.keys():
            self._holders[link] = self._holders[link]._replace(seen_at=now)
        gone = any(now - each.seen_at > STRAY_SECONDS for each in self._holders.values())
        return gone and now - self._published_at > RENEW_SECONDS

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
                self._lost(station, str(error))
            except Exception as error:
                # A fault of the console itself; one more relay never ends the others.
                log.exception("passing on to a relay failed", relay=station.url.address)
                self._lost(station, type(error).__name__)
            finally:
                self._gone(station, "")
            if self._clock() - began > HEALTHY_SECONDS:
                backoff.healthy()
            await asyncio.sleep(backoff.next())

    async def _feed(self, origin: SfuServer, station: SfuServer, publication: Publication) -> None:
        async with self._engine.pass_on(origin, station, publication) as link:
            self._live(station, publication)
            await link.ended.wait()
            self._lost(station, link.why)

    def _live(self, station: SfuServer, publication: Publication) -> None:
        station.feed, station.streams, station.trouble = publication.feed, tuple(publication.streams), ""
        log.info("relay carries the session", relay=station.url.address, room=station.url.room)
        self._tell()

    def _lost(self, station: SfuServer, trouble: str) -> None:
        station.failed_at = self._clock()
        if trouble != station.trouble:
            log.warning("relay does not carry the session", relay=station.url.address, why=trouble)
        station.trouble = trouble
        self._gone(station, trouble)

    def _gone(self, station: SfuServer, trouble: str) -> None:
        if station.live:
            station.feed, station.trouble = 0, trouble or station.trouble
            self._tell()

    def _tell(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()
