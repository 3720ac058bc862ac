"""All configured relays: which of them carry the session now, and which is tried first."""

import asyncio
import math
import time
from collections.abc import Callable, Iterator, Sequence

import structlog

from lockstep.server.sfu.publication import Publication
from lockstep.server.sfu.sfu_server import SfuServer
from lockstep.server.util.broadcast import Broadcast

__all__ = ["SfuServers"]

log = structlog.get_logger(__name__)

DISTRUST_SECONDS = 30.0  # a relay that failed is tried after the others for this long


class SfuServers:
    """The states of the relays. `clock` is monotonic, in s."""

    def __init__(self, servers: Sequence[SfuServer], clock: Callable[[], float] = time.monotonic) -> None:
        self._servers = servers
        self._clock = clock
        self._changed = Broadcast()  # a relay became live or was lost

    def __iter__(self) -> Iterator[SfuServer]:
        return iter(self._servers)

    def __len__(self) -> int:
        return len(self._servers)

    def by_name(self, name: str) -> SfuServer | None:
        return next((each for each in self._servers if each.name == name), None)

    def first_to_try(self) -> SfuServer:
        """Return a relay, one that failed lately only if all did, and the latest failure last, as it may be dead."""
        return min(self._servers, key=self._order)

    def _order(self, server: SfuServer) -> tuple[float, int]:
        distrusted = self._clock() - server.failed_at < DISTRUST_SECONDS
        return server.failed_at if distrusted else -math.inf, int(server.name)

    async def usable(self, lost: str, seconds: float) -> list[SfuServer]:
        """Return the relays that carry the session; wait so long for the first.

        `lost`: the "RELAY-FEED" that is not usable
        """
        deadline = self._clock() + seconds
        while True:
            found = [each for each in self._servers if each.live and f"{each.name}-{each.feed}" != lost]
            if found or self._clock() >= deadline:
                return found
            try:
                async with asyncio.timeout(deadline - self._clock()):
                    await self._changed.wait()
            except TimeoutError:
                continue

    def carries(self, server: SfuServer, publication: Publication) -> None:
        """Note that a relay carries the session from now on."""
        server.feed, server.streams, server.trouble = publication.feed, tuple(publication.streams), ""
        log.info("relay carries the session", relay=server.url.address, room=server.url.room)
        self._changed.send()

    def failed(self, server: SfuServer, trouble: str) -> None:
        """Note that a relay does not carry the session, by a fault."""
        server.failed_at = self._clock()
        if trouble != server.trouble:
            log.warning("relay does not carry the session", relay=server.url.address, why=trouble)
        server.trouble = trouble
        self.gone(server, trouble)

    def gone(self, server: SfuServer, trouble: str) -> None:
        """Note that a relay no longer carries the session, if it did."""
        if server.live:
            server.feed, server.trouble = 0, trouble or server.trouble
            self._changed.send()
