"""A UDP relay between a headless client and its console that delays, loses and freezes packets, exactly repeatable.

It is a `Route` of the client: it puts its own addresses into the offer and the answer, so that everything but HTTP
passes it. One connection a relay; loopback only.
"""

import asyncio
import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

from client.sdp import replace_candidates

__all__ = ["Impairment", "ImpairedPath", "UdpRelay"]

FROZEN_BOUND = 5000  # packets that a frozen path keeps; newest win
CANDIDATE = re.compile(r"^a=candidate:\S+ \d+ \S+ \d+ (\S+) (\d+) typ host", re.MULTILINE)


@dataclass(frozen=True)
class Impairment:
    """Of one direction."""

    delay: float = 0.0  # s
    loss: float = 0.0  # 0 to 1
    jitter: float = 0.0  # s; up to so much is added to the delay, which lets packets overtake each other


class ImpairedPath:
    """One direction, without I/O: what happens to the n-th packet depends on the seed and n alone."""

    def __init__(self, impairment: Impairment, seed: int) -> None:
        self.impairment = impairment
        self.passed = 0
        self.lost = 0
        self._random = random.Random(seed)

    def admit(self) -> float | None:
        """Seconds until this packet arrives, or None when it is lost."""
        fate, late = self._random.random(), self._random.random()
        if fate < self.impairment.loss:
            self.lost += 1
            return None
        self.passed += 1
        return self.impairment.delay + late * self.impairment.jitter


class _Side(asyncio.DatagramProtocol):
    """A socket of the relay. `peer` is where it sends what comes from the other side."""

    def __init__(self, received: Callable[[bytes], None]) -> None:
        self._received = received
        self.transport: asyncio.DatagramTransport | None = None
        self.peer: tuple[str, int] | None = None

    def connection_made(self, transport: Any) -> None:
        self.transport = transport

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        if addr[:2] == self.peer:
            self._received(data)

    def send(self, data: bytes) -> None:
        if self.transport is not None and self.peer is not None and not self.transport.is_closing():
            self.transport.sendto(data, self.peer)

    @property
    def port(self) -> int:
        if self.transport is None:
            raise RuntimeError("enter the relay first")
        port: int = self.transport.get_extra_info("sockname")[1]
        return port


class UdpRelay:
    """Enter it, then give it to `Console(route=…)`."""

    def __init__(self, impairment: Impairment | None = None, *, seed: int = 1) -> None:
        each_way = impairment or Impairment()
        self.up = ImpairedPath(each_way, seed)  # client to console
        self.down = ImpairedPath(each_way, seed + 1)
        self._frozen: list[tuple[_Side, bytes]] | None = None
        self._client = _Side(lambda data: self._forward(self.up, self._console, data))
        self._console = _Side(lambda data: self._forward(self.down, self._client, data))
        self._timers: set[asyncio.TimerHandle] = set()

    async def __aenter__(self) -> Self:
        loop = asyncio.get_running_loop()
        for side in (self._client, self._console):
            await loop.create_datagram_endpoint(lambda side=side: side, local_addr=("127.0.0.1", 0))  # type: ignore[misc]
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for timer in self._timers:
            timer.cancel()
        for side in (self._client, self._console):
            if side.transport is not None:
                side.transport.close()

    def offer(self, sdp: str) -> str:
        """The client's offer, with the address at which the console meets the relay."""
        self._client.peer = _first_candidate(sdp)
        return replace_candidates(sdp, "127.0.0.1", self._console.port)

    def answer(self, sdp: str) -> str:
        """The console's answer, with the address at which the client meets the relay."""
        self._console.peer = _first_candidate(sdp)
        return replace_candidates(sdp, "127.0.0.1", self._client.port)

    def impair(self, impairment: Impairment) -> None:
        """Change both directions from now on."""
        self.up.impairment = self.down.impairment = impairment

    def freeze(self) -> None:
        """Let nothing through until `thaw`; packets wait in the network."""
        self._frozen = self._frozen or []

    def thaw(self) -> None:
        """Deliver everything that waited, at once."""
        waiting, self._frozen = self._frozen or [], None
        for side, data in waiting:
            side.send(data)

    def _forward(self, path: ImpairedPath, to: _Side, data: bytes) -> None:
        delay = path.admit()
        if delay is None:
            return
        if delay == 0:
            self._deliver(to, data)
            return

        def arrive() -> None:
            self._timers.discard(timer)
            self._deliver(to, data)

        timer = asyncio.get_running_loop().call_later(delay, arrive)
        self._timers.add(timer)

    def _deliver(self, to: _Side, data: bytes) -> None:
        if self._frozen is None:
            to.send(data)
            return
        self._frozen.append((to, data))
        del self._frozen[:-FROZEN_BOUND]


def _first_candidate(sdp: str) -> tuple[str, int]:
    match = CANDIDATE.search(sdp)
    if match is None:
        raise ValueError("the description has no host candidate")
    return match[1], int(match[2])
