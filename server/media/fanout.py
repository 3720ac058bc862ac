"""Who is served when: the operator at once, observers in bounded slices of the event loop."""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable
from typing import Protocol

from server.media.frame import EncodedFrame

__all__ = ["FanOut", "Target"]


class Target(Protocol):
    """One stream of one peer."""

    @property
    def priority(self) -> bool:
        """Whether it belongs to the operator."""

    def put(self, frame: EncodedFrame) -> None:
        """Queue a frame; never blocks."""

    def send_next(self) -> bool:
        """Send one queued frame if there is one and the socket takes it; whether another can follow."""


class FanOut:
    """Sends frames to targets. A slow target only fills its own outbox; an observer never delays the operator."""

    def __init__(self, slice_seconds: float, clock: Callable[[], float]) -> None:
        self._slice = slice_seconds
        self._clock = clock
        self._waiting: dict[Target, None] = {}  # observers with frames, in the order they are served
        self._order: deque[Target] = deque()
        self._wake = asyncio.Event()

    def publish(self, frame: EncodedFrame, targets: Iterable[Target]) -> None:
        """Hand a frame to its targets. Returns when the operator's is sent and the others are queued."""
        observers = []
        for target in targets:
            if target.priority:
                target.put(frame)
                while target.send_next():
                    pass
            else:
                observers.append(target)
        for target in observers:
            target.put(frame)
            if target not in self._waiting:
                self._waiting[target] = None
                self._order.append(target)
        if observers:
            self._wake.set()

    def forget(self, target: Target) -> None:
        """A target is gone."""
        if target in self._waiting:
            del self._waiting[target]
            self._order.remove(target)

    async def run(self) -> None:
        """Serve observers until cancelled, at most one slice in each turn of the loop."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._order:
                self.serve()
                await asyncio.sleep(0)  # everything that is ready goes first

    def serve(self) -> None:
        """Serve observers in turn, one frame each, for one slice."""
        deadline = self._clock() + self._slice
        while self._order:
            target = self._order.popleft()
            if target.send_next():
                self._order.append(target)
            else:
                del self._waiting[target]
            if self._clock() >= deadline:
                return
