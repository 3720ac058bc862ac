"""The forwarders of all clients, one for each WHEP session."""

import time
from collections.abc import Sequence

from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.profile import Profile
from lockstep.emulator.transport.client_paths import ClientPaths
from lockstep.emulator.transport.udp_forwarder import UdpForwarder

__all__ = ["Sessions"]

SILENCE = 60.0  # s; a client that has sent nothing for this time is gone
KEPT = 1000  # clients whose counts are kept after they have gone


class Sessions:
    """All forwarders: `open` one, `keep` it under its WHEP resource, `end` it; or `close` all."""

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
        self._forwarders: dict[str, UdpForwarder] = {}  # by path of the WHEP resource, "/whep/abc"

    def __len__(self) -> int:
        return len(self._forwarders)

    def open(self) -> UdpForwarder:
        """Open a forwarder for the next client; its fate depends on the seed and on the number of clients before."""
        self._end_silent()
        self._count += 1
        paths = ClientPaths(self._profile, f"{self._seed} client {self._count}", self._outages)
        self.all_paths.append(paths)
        del self.all_paths[:-KEPT]
        return UdpForwarder(paths, self._deliveries, self._hosts)

    def keep(self, resource: str, forwarder: UdpForwarder) -> None:
        self.end(resource)
        self._forwarders[resource] = forwarder

    def find(self, resource: str) -> UdpForwarder | None:
        return self._forwarders.get(resource)

    def end(self, resource: str) -> None:
        forwarder = self._forwarders.pop(resource, None)
        if forwarder is not None:
            forwarder.close()

    def close(self) -> None:
        for resource in list(self._forwarders):
            self.end(resource)

    def _end_silent(self) -> None:
        now = time.monotonic()
        for resource in [name for name, forwarder in self._forwarders.items() if now - forwarder.heard_at > SILENCE]:
            self.end(resource)
