"""The recorder: starts and ends recordings, says how they go, and makes room for them."""

import asyncio
import secrets
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Protocol

import structlog

from lockstep.protocol.console import RecordingState
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.errors import AlreadyRecording, RecordingFailed
from lockstep.server.event_clock import EventClock
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.recorded_encoding import FrameTaker
from lockstep.server.recording.episodes.episode_before import EpisodeBefore
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.format.topics import PICTURE_FORMATS
from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.retention import Retention
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.times import RecordClock
from lockstep.server.recording.writing.session_records import SessionRecords
from lockstep.server.recording.writing.writer_thread import RecordingThread
from lockstep.server.session_events import SessionEvents

__all__ = ["RecordedMedia", "Recorder", "RecordingWatcher"]

log = structlog.get_logger(__name__)

NEWS_SECONDS = 2.0  # between two reports of how much was recorded
RETRY_SECONDS = 15.0  # after a failure, when recording is automatic
PRUNE_TICKS = 30  # reports between two looks at the directory


class RecordedMedia(Protocol):
    """The part of the media hub that the recorder uses."""

    def record(self, take: FrameTaker | None, keyframe_seconds: float) -> None: ...
    def record_keyframes(self) -> None: ...
    def recorded_codecs(self) -> Mapping[str, str]: ...


class RecordingWatcher(Protocol):
    """Is told of what concerns episodes. All methods are called on the loop and return at once."""

    def recordings_read(self, earlier: EpisodeBefore | None) -> None:
        """What earlier processes have recorded is complete by now; `earlier` is the last episode of it."""

    def recording_ends(self, failure: str) -> None:
        """The recording ends; without a failure what is put into it now is still written."""

    def episode_written(self, episode: str, kept: bool) -> None:
        """The episode's record `kept` is on the disk; False: the episode cannot be kept any more."""

    def picture_recorded(self, stream: str, stamp: int) -> None: ...


class Recorder:
    """Records the session. Run `run` as a task; everything but `stop` is called on the loop and returns at once.

    Args:
        clock: the current event
        tell: tells everyone
        audit: for what the recorder does without being asked
        signing: signs recordings; None: they are not signed
    """

    def __init__(
        self,
        settings: RecordingSettings,
        shelf: RecordingStore,
        clock: EventClock,
        media: RecordedMedia,
        tell: Callable[[RecordingState], None],
        audit: AuditTrail,
        signing: RecordingSigning | None = None,
    ) -> None:
        self.shelf = shelf
        self._settings = settings
        self._media = media
        self._tell = tell
        self._audit = audit
        self._retention = Retention(shelf, audit)
        self._signing = signing
        self._records = SessionRecords(clock, media)
        self._thread: RecordingThread | None = None
        self._since = 0.0
        self._failure = ""
        self._again_at = 0.0  # s, monotonic: earliest automatic start
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stopping = asyncio.Lock()
        self._ended = asyncio.Event()  # the thread ended by itself
        self._watcher: RecordingWatcher | None = None

    def subscribe(self, events: SessionEvents) -> None:
        self._records.subscribe(events)

    def watched_by(self, watcher: RecordingWatcher) -> None:
        self._watcher = watcher

    async def run(self) -> None:
        """Run until cancelled; the file is closed then."""
        self._loop = asyncio.get_running_loop()
        try:
            before = await self._retention.prepare()
            if self._watcher is not None:
                self._watcher.recordings_read(before)
            ticks = 0
            while True:
                if self._settings.automatic and self._thread is None and time.monotonic() >= self._again_at:
                    self._try_again()
                try:
                    async with asyncio.timeout(NEWS_SECONDS):
                        await self._ended.wait()
                except TimeoutError:
                    pass
                if self._ended.is_set():
                    self._ended.clear()
                    await self._give_up()
                elif self._thread is not None:
                    self._tell(self.state())
                    ticks += 1
                    if ticks % PRUNE_TICKS == 1:
                        await self._retention.prune()
        finally:
            await asyncio.shield(self.close())

    def _try_again(self) -> None:
        try:
            self._audit.record("recording", what="started by itself", detail=self.start("", "").recording)
        except RecordingFailed as error:
            self._again_at = time.monotonic() + RETRY_SECONDS
            log.error("the recording cannot start", reason=error.detail)

    # starting and stopping

    def state(self) -> RecordingState:
        """Return the state as everyone is told it."""
        thread = self._thread
        if thread is None:
            return RecordingState(state="failed" if self._failure else "off", detail=self._failure)
        path = thread.parts.path
        return RecordingState(
            state="recording",
            id="" if path is None else path.stem,
            recording=thread.info.recording,
            name=thread.info.name,
            by=thread.info.by,
            since=self._since,
            bytes=thread.parts.bytes_written,
            lost=thread.queue.lost,
            detail="" if path is not None else "waiting for the robot",
        )

    @property
    def automatic(self) -> bool:
        """True if it records without being asked, until somebody ends that."""
        return self._settings.automatic

    @property
    def running(self) -> RecordingThread | None:
        """The thread that writes now; None: nothing is recorded."""
        return self._thread

    def start(self, by: str, name: str) -> RecordingState:
        """Begin a recording.

        Raises:
            AlreadyRecording: one is running.
            RecordingFailed: the directory cannot be used.
        """
        if self._thread is not None:
            raise AlreadyRecording("a recording is running")
        try:
            self.shelf.prepare()
        except OSError as error:
            self._failure = f"{self.shelf.directory}: {error.strerror}"
            self._tell(self.state())
            raise RecordingFailed(self._failure) from error
        times = RecordClock(time.time_ns(), time.monotonic_ns())
        self._since, self._failure = round(time.time(), 3), ""
        self._ended.clear()
        thread = RecordingThread(
            self.shelf.directory,
            self._settings,
            RecordingInfo(recording=_fresh_id(), name=name, by=by),
            lambda: times.at(time.monotonic()),
            lambda: self._call_soon(self._media.record_keyframes),
            lambda: self._call_soon(self._ended.set),
            self._signing,
            lambda episode, kept: self._call_soon(lambda: self._episode_written(episode, kept)),
        )
        self._thread = thread
        self._records.begin(thread.queue, times)
        thread.start()
        self._media.record(self._take_frame, self._settings.keyframe_seconds)
        self._tell(self.state())
        log.info("recording", recording=thread.info.recording, by=by)
        return self.state()

    async def stop(self) -> RecordingState:
        """End the recording, if one is running; returns when the file is closed.

        The state says so when the end of the file could not be written.
        """
        self._settings = self._settings.model_copy(update={"automatic": False})  # ends automatic recording too
        if self._thread is None:
            self._failure = ""
        await self.close()
        self._tell(self.state())
        return self.state()

    async def close(self) -> None:
        """Close the file. Idempotent."""
        async with self._stopping:
            thread = self._thread
            if thread is not None:
                if self._watcher is not None:
                    self._watcher.recording_ends(thread.failure)
                self._media.record(None, self._settings.keyframe_seconds)
                await asyncio.to_thread(thread.close)
                self._thread = None
                self._records.end()
                self._failure = thread.failure
                log.info("recording ended", recording=thread.info.recording, bytes=thread.parts.bytes_written)

    async def _give_up(self) -> None:
        await self.close()
        if self._failure:
            self._again_at = time.monotonic() + RETRY_SECONDS
            self._audit.record("recording", what="failed", detail=self._failure)
            self._tell(self.state())

    def _take_frame(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None:
        self._records.take_frame(stream, codec, frame, attached=attached)
        if self._watcher is not None and codec in PICTURE_FORMATS:
            self._watcher.picture_recorded(stream, frame.stamp)

    def _episode_written(self, episode: str, kept: bool) -> None:
        if self._watcher is not None:
            self._watcher.episode_written(episode, kept)

    def _call_soon(self, call: Callable[[], None]) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(call)


def _fresh_id() -> str:
    return f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{secrets.token_hex(2)}"
