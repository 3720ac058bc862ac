"""The console's WebRTC endpoint: one UDP port for the peers of all its robots."""

import asyncio
from collections import Counter
from collections.abc import Sequence
from typing import Protocol

import structlog

from lockstep.rtc.endpoint import Connection, Endpoint, Listener, Turns
from lockstep.rtc.endpoint import EndpointSettings as WebRtcSettings
from lockstep.rtc.ice.gathering import Advertised
from lockstep.rtc.peer import PeerSettings
from lockstep.rtc.turn import servers as turn
from lockstep.server.util.cooperative_scheduler import turns_of_loop
from lockstep.server.webrtc.ice_servers import IceServer
from lockstep.server.webrtc.media_addresses import MediaHostSettings, media_hosts

__all__ = ["MediaEndpoint"]

log = structlog.get_logger(__name__)

# Each robot has its own bound (`max_peers`); this one is for a fleet of twenty.
OF_ALL_ROBOTS = WebRtcSettings(peers=4096)


class EndpointSettings(MediaHostSettings, Protocol):
    """The settings that the endpoint needs."""

    @property
    def advertise(self) -> tuple[str, ...]: ...


class MediaEndpoint:
    """The endpoint. It opens with the first peer, unless it is opened before. Its owner calls `close`."""

    def __init__(self, settings: EndpointSettings) -> None:
        self._settings = settings
        self._endpoint: Endpoint | None = None
        self._turns = turns_of_loop()  # work for observers ends as soon as something has come
        self._asking = asyncio.Lock()  # one negotiation must not give back what servers have told another

    @property
    def dropped(self) -> Counter[str]:
        """Count of dropped datagrams and packets since the start, by reason."""
        return Counter() if self._endpoint is None else self._endpoint.dropped

    @property
    def connections(self) -> int:
        """Number of connections that have not ended."""
        return 0 if self._endpoint is None else self._endpoint.connections

    async def connect(
        self,
        listener: Listener | None = None,
        *,
        turns: Turns | None = None,
        servers: Sequence[IceServer] = (),
        settings: PeerSettings | None = None,
        controlling: bool = False,
    ) -> Connection:
        """Open a connection at the addresses that this machine has now.

        Args:
            listener: as in `Endpoint.connect`; `turns`, `settings` and `controlling` too
            servers: STUN and TURN servers that are asked for addresses of the console

        Raises:
            TooManyPeers: the endpoint has as many as it may.
        """
        endpoint = self.open()
        async with self._asking:
            if servers:
                asked = [turn.IceServer(x.urls, x.username or None, x.credential or None) for x in servers]
                for refusal in await endpoint.ask(asked):
                    log.warning("a TURN server gave no address", detail=str(refusal) or repr(refusal))
            return endpoint.connect(controlling=controlling, settings=settings, listener=listener, turns=turns)

    def close(self) -> None:
        """Close the endpoint with all connections. Idempotent."""
        if self._endpoint is not None:
            self._endpoint.close()

    def open(self) -> Endpoint:
        """Bind the sockets of the addresses that this machine has now, as far as they are not bound yet.

        Raises:
            OSError: the port of the settings cannot be bound.
        """
        settings = self._settings
        hosts = media_hosts(settings)
        if self._endpoint is None:
            try:
                self._endpoint = self._bound(hosts)
            except OSError:
                if settings.media_port:
                    raise
                self._endpoint = self._bound([])  # a new address may not be ready yet: bind without it
        self._endpoint.use_hosts(hosts)
        for each in self._endpoint.sockets:
            self._turns.yield_to(each)
        return self._endpoint

    def _bound(self, hosts: Sequence[str]) -> Endpoint:
        settings = self._settings
        advertised = [Advertised(each) for each in settings.advertise]
        return Endpoint(
            hosts, settings.media_port, tcp=settings.media_tcp, advertised=advertised, settings=OF_ALL_ROBOTS
        )
