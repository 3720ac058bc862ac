"""Hands the session to a process that speaks to Rerun, and begins again when that ends."""

import asyncio
import os
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress

import structlog

from lockstep.server.event_clock import EventClock
from lockstep.server.media.frame_takers import TakenMedia
from lockstep.server.recording.times import RecordClock
from lockstep.server.recording.writing.session_records import SessionRecords
from lockstep.server.rerun.feed import Feed
from lockstep.server.rerun.settings import RerunSettings, target_of
from lockstep.server.session_events import SessionEvents

__all__ = ["RerunService"]

log = structlog.get_logger(__name__)

MODULE = "lockstep.server.rerun.rerun_process"
RETRY_SECONDS = 5.0  # until a process that has ended is started again
START_SECONDS = 60.0  # until it reads
LOOK_SECONDS = 0.25  # between two looks at the feed
BLOCKED_SECONDS = 10.0  # that the process may take nothing: its viewer does not read, and never will
KEYFRAME_SECONDS = 2.0  # between two keyframes that are asked for after pictures were dropped
END_SECONDS = 5.0  # that the process has for what it got


class RerunService:
    """The live session of one robot for Rerun. Run `run` as a task; everything else is called on the loop.

    Attributes:
        running: set while a process takes the session
        process_id: of that process; None: there is none
    """

    def __init__(
        self,
        settings: RerunSettings,
        clock: EventClock,
        media: TakenMedia,
        keyframe_seconds: float,
        on_dropped: Callable[[int], None],
    ) -> None:
        """`on_dropped` gets the number of items that the console's own queue has dropped since the last call."""
        self.running = asyncio.Event()
        self.process_id: int | None = None
        self._settings = settings
        self._target = target_of(settings.to or "")
        self._media = media
        self._keyframe_seconds = keyframe_seconds
        self._on_dropped = on_dropped
        self._records = SessionRecords(clock, media)

    def subscribe(self, events: SessionEvents) -> None:
        self._records.subscribe(events)

    async def run(self) -> None:
        """Serve until cancelled. A viewer that is not there is tried again."""
        log.info("the session goes to Rerun", kind=self._target.kind, to=self._target.value)
        while True:
            code = await self._serve()
            log.warning("the process for Rerun has ended", code=code, again_in_seconds=RETRY_SECONDS)
            await asyncio.sleep(RETRY_SECONDS)

    async def _serve(self) -> int:
        """Run one process; return its exit code."""
        async with self._process() as (process, feed):
            if not await _is_ready(process):
                return await _killed(process)
            feed.start()
            self._records.begin(feed, RecordClock(time.time_ns(), time.monotonic_ns()))
            self._media.record(self._records.take_frame, self._keyframe_seconds)
            self.process_id = process.pid
            self.running.set()
            told, keyframe_at = 0, time.monotonic()
            while process.returncode is None:
                with suppress(TimeoutError):
                    await asyncio.wait_for(process.wait(), LOOK_SECONDS)
                now = time.monotonic()
                self._on_dropped(feed.dropped - told)
                told = feed.dropped
                if now - keyframe_at >= KEYFRAME_SECONDS and feed.lost_pictures():
                    keyframe_at = now
                    self._media.request_keyframes()
                if feed.blocked_for(now) > BLOCKED_SECONDS:
                    log.warning("Rerun takes nothing", seconds=BLOCKED_SECONDS)
                    return await _killed(process)
            return process.returncode

    @asynccontextmanager
    async def _process(self) -> AsyncIterator[tuple[asyncio.subprocess.Process, Feed]]:
        reading, writing = os.pipe()
        feed = Feed(writing)
        process: asyncio.subprocess.Process | None = None
        try:
            kind, value = self._target
            words = (sys.executable, "-m", MODULE, kind, value, str(self._settings.file_bytes))
            process = await asyncio.create_subprocess_exec(*words, stdin=reading, stdout=asyncio.subprocess.PIPE)
            os.close(reading)
            reading = -1
            yield process, feed
        finally:
            self.running.clear()
            self.process_id = None
            self._records.end()
            self._media.record(None, self._keyframe_seconds)
            feed.close()
            if reading >= 0:
                os.close(reading)
            await asyncio.shield(_end(process, feed))


async def _is_ready(process: asyncio.subprocess.Process) -> bool:
    """Wait until the process has loaded what it needs, which takes seconds on a small computer."""
    if process.stdout is None:
        return False
    try:
        async with asyncio.timeout(START_SECONDS):
            return bool(await process.stdout.readline())
    except TimeoutError:
        return False


async def _killed(process: asyncio.subprocess.Process) -> int:
    with suppress(ProcessLookupError):
        process.kill()
    return await process.wait()


async def _end(process: asyncio.subprocess.Process | None, feed: Feed) -> None:
    """Give the process its time for what it got, then kill it: only then does its feed surely end."""
    if process is not None:
        try:
            await asyncio.wait_for(process.wait(), END_SECONDS)
        except TimeoutError:
            await _killed(process)
    await asyncio.to_thread(feed.join)
