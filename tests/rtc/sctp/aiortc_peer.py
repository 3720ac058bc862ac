"""aiortc's SCTP over a DTLS transport that is a queue, and a core of ours at the other end, on asyncio's clock.

aiortc's `RTCSctpTransport` takes packets by `_handle_data` and gives them to `_send_data` of its transport; there is
no public way to put anything else in the place of DTLS.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from random import Random
from typing import Any

from aiortc import RTCSctpCapabilities, RTCSctpTransport

from lockstep.rtc.channels import ChannelEvent, DataChannels

__all__ = ["AiortcPair", "aiortc_pair"]


class _Transport:
    """What aiortc's SCTP wants of DTLS."""

    state = "connected"

    def __init__(self, role: str, send: Callable[[bytes], None]) -> None:
        self._role = role
        self._send = send

    def _register_data_receiver(self, receiver: object) -> None: ...

    def _unregister_data_receiver(self, receiver: object) -> None: ...

    async def _send_data(self, data: bytes) -> None:
        self._send(data)


class AiortcPair:
    """`ours` and `theirs`; each packet is lost with the chance `loss`."""

    def __init__(self, ours: DataChannels, loss: float, seed: int) -> None:
        self.ours = ours
        self.loss = loss
        self.events: list[ChannelEvent] = []
        self.random = Random(seed)
        self.loop = asyncio.get_running_loop()
        self.to_them: asyncio.Queue[bytes] = asyncio.Queue()
        self.timer: asyncio.TimerHandle | None = None
        self.changed = asyncio.Event()
        role = "server" if ours.is_client else "client"
        transport: Any = _Transport(role, self.from_them)
        self.theirs = RTCSctpTransport(transport)
        self.handle: Callable[[bytes], Awaitable[None]] = self.theirs._handle_data

    def from_them(self, data: bytes) -> None:
        if self.random.random() >= self.loss:
            self.loop.call_soon(self.receive, data)

    def receive(self, data: bytes) -> None:
        self.ours.receive_packet(data, self.loop.time())
        self.flush()

    def flush(self) -> None:
        for packet in self.ours.packets_to_send():
            if self.random.random() >= self.loss:
                self.to_them.put_nowait(packet)
        if events := self.ours.events():
            self.events += events
            self.changed.set()
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None
        if (due := self.ours.timer()) is not None:
            self.timer = self.loop.call_at(due, self.expire)

    def expire(self) -> None:
        self.timer = None
        self.ours.handle_timer(self.loop.time())
        self.flush()

    async def feed_them(self) -> None:
        while True:
            await self.handle(await self.to_them.get())

    async def until(self, condition: Callable[[], bool]) -> None:
        """Asks again after each event here and, for theirs, each millisecond."""
        async with asyncio.timeout(50):
            while not condition():
                self.changed.clear()
                try:
                    async with asyncio.timeout(0.001):
                        await self.changed.wait()
                except TimeoutError:
                    continue


@asynccontextmanager
async def aiortc_pair(ours: DataChannels, loss: float = 0.0, seed: int = 1) -> AsyncIterator[AiortcPair]:
    """Both started; the handshake may be under way still."""
    pair = AiortcPair(ours, loss, seed)
    feeding = asyncio.ensure_future(pair.feed_them())
    try:
        await pair.theirs.start(RTCSctpCapabilities(maxMessageSize=0), 5000)
        ours.association.start(pair.loop.time())
        pair.flush()
        yield pair
    finally:
        if pair.timer is not None:
            pair.timer.cancel()
        await pair.theirs.stop()
        feeding.cancel()
        await asyncio.gather(feeding, return_exceptions=True)
