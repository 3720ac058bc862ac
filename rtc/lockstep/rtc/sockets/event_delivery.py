"""Hands the events of a peer to a listener as they happen, or keeps them, within bounds, for an iteration."""

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Sequence

from lockstep.rtc.peer_events import PacketReceived, PeerEnded, PeerEvent
from lockstep.rtc.sockets.endpoint_settings import EndpointSettings

__all__ = ["EventDelivery", "Listener"]

Listener = Callable[[PeerEvent], None]


class EventDelivery:
    """`counts` has the events that were dropped because the application did not read them."""

    def __init__(
        self, listener: Listener | None, settings: EndpointSettings, counts: Counter[str], full: Callable[[], None]
    ) -> None:
        """`full`: called when so much waits that the application counts as dead."""
        self.ended = False  # PeerEnded waits, or was read
        self._counts = counts
        self._settings = settings
        self._full = full
        self._loop = asyncio.get_running_loop()
        self._listener = listener
        self._telling = False  # True while the listener is called, which may use the connection
        self._waiting: deque[PeerEvent] = deque()
        self._arrived = asyncio.Event()

    @property
    def has_listener(self) -> bool:
        return self._listener is not None

    def listen(self, listener: Listener) -> None:
        """Pass all further events to `listener`, after those that nobody has read. Only once."""
        self._listener = listener
        self._tell(listener, ())

    async def next_event(self) -> PeerEvent:
        """Return the oldest event. Raises StopAsyncIteration after the last."""
        while not self._waiting:
            if self.ended:
                raise StopAsyncIteration
            self._arrived.clear()
            await self._arrived.wait()
        return self._waiting.popleft()

    def hand_out(self, events: Sequence[PeerEvent]) -> None:
        if self._listener is not None:
            self._tell(self._listener, events)
            return
        for event in events:
            self._keep(event)

    def _tell(self, listener: Listener, events: Sequence[PeerEvent]) -> None:
        """Call the listener in order, also when it causes further events. An exception is the listener's fault."""
        self._waiting.extend(events)
        if self._telling:
            return
        self._telling = True
        try:
            while self._waiting:
                event = self._waiting.popleft()
                self.ended = self.ended or isinstance(event, PeerEnded)
                try:
                    listener(event)
                except Exception as error:
                    self._loop.call_exception_handler({"message": "a listener failed", "exception": error})
        finally:
            self._telling = False

    def _keep(self, event: PeerEvent) -> None:
        waiting = len(self._waiting)
        if isinstance(event, PacketReceived) and waiting >= self._settings.waiting_packets:
            self._counts["packet_not_read"] += 1
            return
        if waiting >= self._settings.waiting_events and not isinstance(event, PeerEnded):
            self._counts["event_not_read"] += 1
            self._full()
            return
        self.ended = isinstance(event, PeerEnded)
        self._waiting.append(event)
        self._arrived.set()
