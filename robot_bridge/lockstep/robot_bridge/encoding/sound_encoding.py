"""Encodes one microphone's sound in a thread, in order; when the thread is too slow, the oldest is left out."""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.encoding.encoder_thread import EncoderThread
from lockstep.robot_bridge.encoding.failure_log import FailureLog
from lockstep.robot_bridge.encoding.sound_encoder import OpusEncoder

__all__ = ["SoundEncoding"]

MOST_WAITING = 10  # segments


class SoundEncoding:
    """Takes segments with `put`, on the event loop; hands packets to `emit` there, in order. Await `run`."""

    def __init__(
        self, stream: str, encoder: OpusEncoder, emit: Callable[[Media], None], count: Callable[[str], None]
    ) -> None:
        """`count` counts segments that are left out, by reason."""
        self._stream = stream
        self._encoder = encoder
        self._emit = emit
        self._count = count
        self._waiting: deque[Media] = deque()
        self._busy = False
        self._failures = FailureLog(stream, count)
        self._loop: asyncio.AbstractEventLoop | None = None  # None: not running
        self._thread: EncoderThread | None = None

    async def run(self) -> None:
        """Encode until cancelled."""
        thread = EncoderThread(f"encode-{self._stream}"[:15])
        self._loop, self._thread = asyncio.get_running_loop(), thread
        try:
            await self._loop.create_future()
        finally:
            self._loop = self._thread = None
            await thread.close()

    def put(self, media: Media) -> None:
        """Take a segment."""
        if len(self._waiting) >= MOST_WAITING:
            self._waiting.popleft()
            self._count("encoder_busy")
        self._waiting.append(media)
        self._begin_next()

    def _begin_next(self) -> None:
        if self._busy or not self._waiting or self._loop is None or self._thread is None:
            return
        failure = self._thread.submit(self._work, self._loop, self._waiting.popleft())
        if failure is None:
            self._busy = True
        else:
            self._failures.add(failure)

    def _work(self, loop: asyncio.AbstractEventLoop, media: Media) -> None:
        """Encode in the thread."""
        result: Sequence[Media] | Exception
        try:
            result = self._encoder.encode(media)
        except Exception as error:  # an unexpected error of the library; the stream must go on
            result = error
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(self._encoded, result)

    def _encoded(self, result: Sequence[Media] | Exception) -> None:
        self._busy = False
        if self._loop is None:  # ended meanwhile
            return
        if isinstance(result, Exception):
            self._failures.add(result)
        else:
            for packet in result:
                self._emit(packet)
        self._begin_next()
