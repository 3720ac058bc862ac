"""Encodes one camera's pictures in a thread: the newest one wins, and none is encoded that no link could take."""

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple, Protocol

import msgspec

from lockstep.protocol.messages import Media
from lockstep.protocol.traces.trace import PictureSpans, join_spans, span_ms
from lockstep.robot_bridge.encoding.encoder_thread import EncoderThread
from lockstep.robot_bridge.encoding.encoding_requests import EncodingGoal, FrameRateGate, KeyframeSpacing
from lockstep.robot_bridge.encoding.failure_log import FailureLog

__all__ = ["EncodedPicture", "PictureEncoder", "PictureEncoding", "Requests"]


class EncodedPicture(NamedTuple):
    """One access unit of H.264, Annex B."""

    data: bytes
    keyframe: bool
    width: int
    height: int


class PictureEncoder(Protocol):
    """Encodes one camera's pictures. Used from one thread; raises EncodingFailed."""

    def encode(self, media: Media, goal: EncodingGoal, keyframe: bool) -> EncodedPicture: ...


class Requests(Protocol):
    """What the links ask for."""

    def goal(self, stream: str) -> EncodingGoal: ...
    def wants_keyframe(self, stream: str) -> bool: ...
    def keyframe_made(self, stream: str) -> None: ...


class PictureEncoding:
    """Takes pictures with `put`, on the event loop; hands encoded ones to `emit` there, in order. Await `run`.

    A picture that is left out is left out before it is encoded, so that all that are sent can be decoded.
    """

    def __init__(
        self,
        stream: str,
        encoder: PictureEncoder,
        requests: Requests,
        has_room: Callable[[], bool],
        emit: Callable[[Media], None],
        count: Callable[[str], None],
        then: Callable[[Media], None] = lambda media: None,
    ) -> None:
        """The parts around it, all called on the event loop.

        Args:
            has_room: whether a link takes a picture now
            count: counts pictures that are left out, by reason
            then: takes each picture, as the camera made it, when this encoding is through with it
        """
        self._stream = stream
        self._encoder = encoder
        self._requests = requests
        self._has_room = has_room
        self._emit = emit
        self._count = count
        self._then = then
        self._gate = FrameRateGate()
        self._spacing = KeyframeSpacing()
        self._waiting: Media | None = None  # the newest picture, while the encoder is busy
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
        """Take a picture; a newer one replaces one that still waits."""
        if self._waiting is not None:
            self._count("encoder_busy")
        self._waiting = media
        self._begin_next()

    def _begin_next(self) -> None:
        media, loop, thread = self._waiting, self._loop, self._thread
        if self._busy or media is None or loop is None or thread is None:
            return
        self._waiting = None
        goal = self._requests.goal(self._stream)
        if not self._gate.takes(media.time, goal.frame_rate):
            self._then(media)
            return
        if not self._has_room():
            self._count("link_busy")
            return
        keyframe = self._requests.wants_keyframe(self._stream) and self._spacing.allows(media.time)
        failure = thread.submit(self._work, loop, media, goal, keyframe)
        if failure is None:
            self._busy = True
        else:
            self._failures.add(failure)
            self._then(media)

    def _work(self, loop: asyncio.AbstractEventLoop, media: Media, goal: EncodingGoal, keyframe: bool) -> None:
        """Encode in the thread."""
        result: EncodedPicture | Exception
        began = time.monotonic()
        try:
            result = self._encoder.encode(media, goal, keyframe)
        except Exception as error:  # an unexpected error of the library; the stream must go on
            result = error
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(self._encoded, media, result, time.monotonic() - began)

    def _encoded(self, media: Media, result: EncodedPicture | Exception, seconds: float) -> None:
        """`seconds`: that the encoding took."""
        self._busy = False
        if self._loop is None:  # ended meanwhile
            return
        if isinstance(result, Exception):
            self._failures.add(result)
        else:
            if result.keyframe:
                self._requests.keyframe_made(self._stream)
                self._spacing.made(media.time)
            encoded = msgspec.structs.replace(
                media,
                codec="h264",
                payload=result.data,
                width=result.width,
                height=result.height,
                keyframe=result.keyframe,
                spans=join_spans(
                    PictureSpans() if media.spans is msgspec.UNSET else media.spans,
                    PictureSpans(bridge_encode_ms=span_ms(seconds)),
                ),
            )
            self._emit(encoded)
        self._begin_next()
        self._then(media)
