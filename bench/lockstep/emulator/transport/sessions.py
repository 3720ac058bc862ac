"""The relays of all clients, one for each WHEP session."""

import time
from collections.abc import Sequence

from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.profile import Profile
from lockstep.emulator.transport.client_paths import ClientPaths
from lockstep.emulator.transport.udp_relay import UdpRelay

__all__ = ["Sessions"]

SILENCE = 60.0  # s; a client that has sent nothing for this time is gone
KEPT = 1000  # clients whose counts are kept after they have gone


class Sessions:
    """All relays: `open` one, `keep` it under its WHEP resource, `end` it; or `close` all."""

    def __init__(
        self, profile: Profile, seed: int, outages: Outages, deliveries: Deliveries, hosts: Sequence[str]
    ) -> None:
        self.all_paths: list[ClientPaths] = []  # of every client so far, in the order of their arrival
        self._profile = profile
        self._seed = seed
        self._outages = outages
        self._deliveries = deliveries
        self._hosts = hosts
        self._count = 0
        self._relays: dict[str, UdpRelay] = {}  # by path of the WHEP resource, "/whep/abc"

    def __len__(self) -> int:
        return len(self._relays)

    def open(self) -> UdpRelay:
        """Open a relay for the next client; its fate depends on the seed and on the number of clients before."""
        self._end_silent()
        self._count += 1
        paths = ClientPaths(self._profile, f"{self._seed} client {self._count}", self._outages)
        self.all_paths.append(paths)
        del self.all_paths[:-KEPT]
        return UdpRelay(paths, self._deliveries, self._hosts)

    def keep(self, resource: str, relay: UdpRelay) -> None:
        self.end(resource)
        self._relays[resource] = relay

    def find(self, resource: str) -> UdpRelay | None:
        return self._relays.get(resource)

    def end(self, resource: str) -> None:
        relay = self._relays.pop(resource, None)
        if relay is not None:
            relay.close()

    def close(self) -> None:
        for resource in list(self._relays):
            self.end(resource)

    def _end_silent(self) -> None:
        now = time.monotonic()
        for resource in [name for name, relay in self._relays.items() if now - relay.heard_at > SILENCE]:
            self.end(resource)
