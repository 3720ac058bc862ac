"""The console's WebRTC endpoint: one UDP port for the peers of all its robots."""

import asyncio
from collections import Counter
from collections.abc import Sequence
from typing import Protocol

import structlog

from rtc.endpoint import Connection, Endpoint, Listener, Turns
from rtc.ice.gathering import Advertised
from rtc.turn import servers as turn
from server.ice_servers import IceServer
from server.media_addresses import MediaHostSettings, media_hosts

__all__ = ["MediaEndpoint"]

log = structlog.get_logger(__name__)


class EndpointSettings(MediaHostSettings, Protocol):
    """The settings that it needs."""

    @property
    def advertise(self) -> tuple[str, ...]: ...


class MediaEndpoint:
    """Opens with the first peer. Whoever has it calls `close`."""

    def __init__(self, settings: EndpointSettings) -> None:
        self._settings = settings
        self._endpoint: Endpoint | None = None
        self._asking = asyncio.Lock()  # what servers have told one negotiation is not given back by the next

    @property
    def dropped(self) -> Counter[str]:
        """What came and was not used, by reason, since the start."""
        return Counter() if self._endpoint is None else self._endpoint.dropped

    async def connect(
        self, listener: Listener, *, turns: Turns | None = None, servers: Sequence[IceServer] = ()
    ) -> Connection:
        """A connection that answers an offer, at the addresses that this machine has now.

        Args:
            listener: as of `Endpoint.connect`; `turns` too
            servers: STUN and TURN servers that are asked for addresses of the console's own

        Raises:
            TooManyPeers: the endpoint has as many as it may.
        """
        endpoint = self._open()
        async with self._asking:
            if servers:
                asked = [turn.IceServer(x.urls, x.username or None, x.credential or None) for x in servers]
                for refusal in await endpoint.ask(asked):
                    log.warning("a TURN server gave no address", detail=str(refusal))
            return endpoint.connect(controlling=False, listener=listener, turns=turns)

    def close(self) -> None:
        """With all connections. Idempotent."""
        if self._endpoint is not None:
            self._endpoint.close()

    def _open(self) -> Endpoint:
        hosts = media_hosts(self._settings)
        if self._endpoint is None:
            advertised = [Advertised(each) for each in self._settings.advertise]
            try:
                self._endpoint = Endpoint(hosts, advertised=advertised)
            except OSError:  # an address that has just come may not be ready yet: without it
                self._endpoint = Endpoint([], advertised=advertised)
        self._endpoint.use_hosts(hosts)
        return self._endpoint
