"""The thread that writes a recording. The console's loop only appends to a bounded queue."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

import structlog

from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing.recording_parts import RecordingParts
from lockstep.server.recording.writing.recording_queue import Lost, RecordingQueue

__all__ = ["RecordingThread"]

log = structlog.get_logger(__name__)

DRAIN_SECONDS = 0.05  # between two looks at the queue: nobody is woken for each item


class RecordingThread:
    """Writes a recording: takes from its queue, and writes the parts. `close` from another thread waits for the end.

    Args:
        now: ns since 1970 on the recording's clock
        on_part, on_episode: as of RecordingParts; called from the thread
        on_end: called from the thread when it ends by itself
        signing: signs the files; None: they are not signed

    Attributes:
        queue: the loop puts into it, at any rate
        parts: the files; look at them only
        failure: why it ended by itself; "" while it runs, or when it was closed
    """

    def __init__(
        self,
        directory: Path,
        settings: RecordingSettings,
        info: RecordingInfo,
        now: Callable[[], int],
        on_part: Callable[[], None],
        on_end: Callable[[], None],
        signing: RecordingSigning | None = None,
        on_episode: Callable[[str, bool], None] = lambda episode, kept: None,
    ) -> None:
        self.info = info
        self.failure = ""
        self.queue = RecordingQueue()
        self.parts = RecordingParts(directory, settings, info, on_part, on_episode, signing)
        self._now = now
        self._on_end = on_end
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """Write the waiting items, and end. Blocks; idempotent."""
        self._closing.set()
        if self._thread.ident is not None:
            self._thread.join()

    @property
    def running(self) -> bool:
        return self._thread.is_alive()

    def _run(self) -> None:
        try:
            while not self._closing.wait(DRAIN_SECONDS):
                self._drain()
            self._drain()
            self.parts.close()
        except (RecordingError, OSError) as error:
            self._fail(str(error))
        except Exception as error:
            log.exception("the recording failed")
            self._fail(f"{type(error).__name__}: {error}")

    def _drain(self) -> None:
        for item in self.queue.take():
            if isinstance(item, Lost):
                self.parts.take_lost(item.items)
            else:
                self.parts.take(item)
            time.sleep(0)  # the loop goes first
        if self.parts.path is None:
            return
        if lost := self.queue.take_lost():
            self.parts.take_lost(lost)
        self.parts.flush_if_due(self._now())

    def _fail(self, reason: str) -> None:
        self.failure = reason
        log.error("the recording ended", reason=reason)
        self.parts.fail(reason)
        self._on_end()
