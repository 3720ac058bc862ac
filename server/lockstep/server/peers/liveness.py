"""Whether a peer has connected in time, whether it still speaks, and its end."""

import asyncio

__all__ = ["Liveness"]


class Liveness:
    """The times of one peer. `watch` waits for its end, or names the reason to end it.

    Attributes:
        speaks: True once it has a channel to speak on. Before, as with a plain WHEP player, ICE consent watches it.
    """

    def __init__(self, connect_seconds: float, silence_seconds: float) -> None:
        self.speaks = False
        self._connect_seconds = connect_seconds
        self._silence_seconds = silence_seconds
        self._loop = asyncio.get_running_loop()
        self._heard_at = self._loop.time()
        self._connected = asyncio.Event()
        self._ended = asyncio.Event()

    @property
    def connected(self) -> bool:
        """True if it was connected at least once, or has ended."""
        return self._connected.is_set()

    def connect(self) -> None:
        self.heard(self._loop.time())
        self._connected.set()

    def heard(self, now: float) -> None:
        """Note a sign of life."""
        self._heard_at = now

    def end(self) -> None:
        self._ended.set()
        self._connected.set()

    async def until_ended(self) -> None:
        await self._ended.wait()

    async def watch(self) -> str:
        """Wait until `end` is called, and return ""; or until the peer has to end, and return the reason."""
        try:
            async with asyncio.timeout(self._connect_seconds):
                await self._connected.wait()
        except TimeoutError:
            return "never connected"
        while not self._ended.is_set():
            try:
                async with asyncio.timeout_at(self._heard_at + self._silence_seconds):
                    await self._ended.wait()
            except TimeoutError:
                now = self._loop.time()
                if not self.speaks:
                    self._heard_at = now
                elif now - self._heard_at >= self._silence_seconds:
                    return "silent"
        return ""
