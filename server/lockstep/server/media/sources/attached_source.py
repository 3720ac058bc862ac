"""One attached source: its process and its state."""

import asyncio
import sys
from collections.abc import Callable

import msgspec
import structlog

from lockstep.server.media.sources.reader_process import ReaderProcess
from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.sources.source_wire import Captured, Said, SourceState, Trouble
from lockstep.server.util.backoff import Backoff

__all__ = ["AttachedSource"]

log = structlog.get_logger(__name__)

PATIENCE = 30.0  # s without a message: the device hangs
COMMAND = (sys.executable, "-m", "lockstep.server.media.sources.reader")


class AttachedSource:
    """Await `run`; it ends when it is cancelled, with its process and thread.

    Attributes:
        state, detail: its state, and a description in words without its address
    """

    def __init__(
        self,
        spec: SourceSpec,
        captured: Callable[[Captured], None],
        changed: Callable[[], None],
        failed: Callable[[str], None],
        command: tuple[str, ...] = COMMAND,
    ) -> None:
        """`captured`, `changed` and `failed` are called on the loop; the last with a stable reason."""
        self.spec = spec
        self.state: SourceState = "connecting"
        self.detail = ""
        self._captured = captured
        self._changed = changed
        self._failed = failed
        self._process = ReaderProcess(spec.name, command, self._take, lambda: PATIENCE)

    @property
    def dropped(self) -> int:
        """Media that came faster than the loop took them."""
        return self._process.dropped

    async def run(self) -> None:
        """Run until cancelled. A process that dies is started again, each time after a longer wait."""
        backoff = Backoff(0.5, 10.0)
        loop = asyncio.get_running_loop()
        while True:
            began = loop.time()
            why = await self._process.run(msgspec.json.encode(self.spec) + b"\n")
            self._trouble(Trouble(why, "the source's process ended" if why == "died" else "the source's process hangs"))
            if loop.time() - began > PATIENCE:
                backoff.healthy()
            await asyncio.sleep(backoff.next())

    def _take(self, said: Said) -> None:
        if isinstance(said, Captured):
            self._captured(said)
        elif isinstance(said, Trouble):
            self._trouble(said)
        else:
            log.info("source live", source=self.spec.name, gives=said.detail)
            self._enter("live", said.detail)

    def _trouble(self, trouble: Trouble) -> None:
        self._failed(trouble.reason)
        if (self.state, self.detail) != ("reconnecting", trouble.detail):
            log.warning("source failed", source=self.spec.name, reason=trouble.reason, detail=trouble.detail)
        self._enter("reconnecting", trouble.detail)

    def _enter(self, state: SourceState, detail: str) -> None:
        if (state, detail) != (self.state, self.detail):
            self.state, self.detail = state, detail
            self._changed()
