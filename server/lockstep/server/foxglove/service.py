"""Serves the session live to Foxglove and other viewers, with the topics and messages that a recording has."""

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

import structlog

from lockstep.server.event_clock import EventClock
from lockstep.server.foxglove.publishing_thread import PublishingThread
from lockstep.server.foxglove.settings import FoxgloveSettings
from lockstep.server.foxglove.subscriptions import Subscribers, Subscriptions
from lockstep.server.media.frame_takers import TakenMedia
from lockstep.server.recording.times import RecordClock
from lockstep.server.recording.writing.session_records import SessionRecords
from lockstep.server.session_events import SessionEvents

if TYPE_CHECKING:
    from lockstep.server.foxglove.sdk_server import SdkServer

__all__ = ["FoxgloveService"]

log = structlog.get_logger(__name__)

RETRY_SECONDS = 5.0  # until an address that could not be listened on is tried again
LOOK_SECONDS = 0.25  # between two looks at who subscribed
REPEAT_SECONDS = 5.0  # between two repetitions of the state, for those who subscribe to what others watch already
KEYFRAME_SECONDS = 2.0  # between two keyframes for those who subscribe: they cost the operator's path


class FoxgloveService:
    """The Foxglove server of one robot. Run `run` as a task; everything else is called on the loop.

    Streams are taken, and encoded if nobody else takes them, only while somebody subscribed to one. The state that
    holds is put once more when a topic is newly subscribed to, and at intervals: the protocol repeats nothing.

    Attributes:
        port: that it listens on; 0 while it does not
        listening: set while it listens
    """

    def __init__(
        self,
        settings: FoxgloveSettings,
        clock: EventClock,
        media: TakenMedia,
        keyframe_seconds: float,
        on_dropped: Callable[[int], None],
        on_fault: Callable[[str, Exception], None],
    ) -> None:
        """Create the service.

        Args:
            on_dropped: gets the number of items that the console's own queue has dropped since the last call
            on_fault: gets the name of the service and the exception when a message cannot be encoded
        """
        self.port = 0
        self.listening = asyncio.Event()
        self._settings = settings
        self._media = media
        self._keyframe_seconds = keyframe_seconds
        self._on_dropped = on_dropped
        self._on_fault = on_fault
        self._records = SessionRecords(clock, media)
        self._takes_media = False
        self._keyframe_wanted = False  # somebody waits for one, or pictures were dropped
        self._keyframe_at = 0.0  # s, monotonic: of the last one that was asked for

    def subscribe(self, events: SessionEvents) -> None:
        self._records.subscribe(events)

    async def run(self) -> None:
        """Serve until cancelled. An address that cannot be listened on is logged, and tried again."""
        from lockstep.server.foxglove.sdk_server import SdkServer

        loop = asyncio.get_running_loop()

        def failed(error: Exception) -> None:
            with suppress(RuntimeError):  # the loop has ended meanwhile
                loop.call_soon_threadsafe(self._on_fault, "foxglove", error)

        while True:
            try:
                # Listening is a bind, and no name is looked up: nothing that blocks the loop.
                server = SdkServer(self._settings.host, self._settings.port or 0)
                break
            except (RuntimeError, OSError) as error:
                log.error("the Foxglove server cannot listen", host=self._settings.host, reason=str(error))
                await asyncio.sleep(RETRY_SECONDS)
        thread = PublishingThread(server, failed)
        try:
            thread.start()
            self.port = server.port
            self.listening.set()
            log.info("Foxglove server", address=f"ws://{self._settings.host}:{server.port}")
            await self._serve(thread, server)
        finally:
            self._records.end()
            self._media.record(None, self._keyframe_seconds)
            self._takes_media = False
            self.listening.clear()
            self.port = 0
            await asyncio.shield(asyncio.to_thread(_close, thread, server.stop))

    async def _serve(self, thread: PublishingThread, server: "SdkServer") -> None:
        times = RecordClock(time.time_ns(), time.monotonic_ns())
        subscriptions = Subscriptions()
        self._repeat(thread, times)  # the topics are offered before anybody comes
        repeated_at, told = time.monotonic(), 0
        while True:
            await asyncio.sleep(LOOK_SECONDS)
            wanted, now = subscriptions.look(server.subscribed()), time.monotonic()
            thread.watched = wanted.any
            if wanted.newcomer or (wanted.any and now - repeated_at >= REPEAT_SECONDS):
                repeated_at = now
                server.yield_to_the_operator()
                self._repeat(thread, times)
            self._keyframe_wanted |= thread.lost_pictures()
            self._take_media(wanted)
            self._on_dropped(thread.dropped - told)
            told = thread.dropped

    def _repeat(self, thread: PublishingThread, times: RecordClock) -> None:
        """Put the state that holds."""
        thread.repeats = True
        self._records.begin(thread, times)
        thread.repeats = False

    def _take_media(self, wanted: Subscribers) -> None:
        now = time.monotonic()
        self._keyframe_wanted |= wanted.media_newcomer
        if wanted.media != self._takes_media:
            self._takes_media, self._keyframe_at, self._keyframe_wanted = wanted.media, now, False
            self._media.record(self._records.take_frame if wanted.media else None, self._keyframe_seconds)
        elif wanted.media and self._keyframe_wanted and now - self._keyframe_at >= KEYFRAME_SECONDS:
            self._keyframe_at, self._keyframe_wanted = now, False
            self._media.request_keyframes()


def _close(thread: PublishingThread, stop: Callable[[], None]) -> None:
    thread.close()
    stop()
