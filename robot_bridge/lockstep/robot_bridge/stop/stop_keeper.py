"""Keeps the latched stop on the robot's disk, away from the loop, and answers the clients that pressed STOP.

It does the I/O for `stop_latch.py` by `stop_store.py`. Without a directory the latch is kept in memory only, and every
answer says so.
"""

import asyncio
import logging
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

from lockstep.protocol.messages import StopTaken
from lockstep.robot_bridge.errors import StateDirUnusable
from lockstep.robot_bridge.stop.stop_latch import StopLatch
from lockstep.robot_bridge.stop.stop_store import RESERVED, Kept, StopStore, start_of, wall_microseconds

__all__ = ["StopAsker", "StopKeeper"]

RETRY = 1.0  # s between two tries to write
MAX_WAITING = 256  # presses that wait for the disk; a further one is answered as not kept, and its repeat waits anew
LOOK = 5.0  # s between two checks that the files are still there
CLOSE_TIMEOUT = 3.0  # s for the disk when the bridge ends; after that the next start finds that it did not end in order

_logger = logging.getLogger(__name__)

Result = TypeVar("Result")
Written = Callable[[int, str], None]  # version of the latch, and why it could not be written or ""


class StopAsker(Protocol):
    """A client that pressed STOP."""

    def send(self, message: StopTaken) -> None: ...


class _Waiting(NamedTuple):
    asker: StopAsker
    answer: StopTaken
    version: int  # of the latch that has this press


class StopKeeper:
    """Writes every change of a latch to the disk.

    Call `open` before the first message, `changed` after each possible change of the latch, and `close` at the end.
    """

    def __init__(self, directory: Path | None, older: Sequence[Path] = ()) -> None:
        """`older`: directories whose latch is taken over if `directory` is new."""
        self._store = None if directory is None else StopStore(directory, older)
        self._latch = StopLatch()
        self._written: Written = lambda version, error: None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="stop-disk")
        self._waiting: list[_Waiting] = []
        self._wake = asyncio.Event()
        self._on_disk = -1  # version that was written last
        self._reserved = 0  # numbers up to this are reserved
        self._writing: asyncio.Task[None] | None = None
        self._trouble = ""  # why the latch cannot be written; "" while it can

    async def open(self, now: float) -> StopLatch:
        """Return the latch as it was left, or stopped with the reason found, and write to the disk that a bridge runs.

        Raises:
            StateDirInUse: another bridge uses the directory.
            StateDirUnusable: the directory cannot be used.
        """
        wall = wall_microseconds()
        if self._store is None:
            self._latch = StopLatch(numbers_after=wall)
            return self._latch
        start = start_of(await self._in_thread(self._store.open), wall)
        self._latch = StopLatch(start.record, numbers_after=start.numbers_after, keeps=True, now=now)
        if start.stop_reason:
            self._latch.stop("", "robot bridge", start.stop_reason, now)
            _logger.warning("the robot starts stopped: %s", start.stop_reason)
        try:
            await self._write(self._store, ended=False)
        except OSError as error:
            raise StateDirUnusable(str(error)) from error
        self._latch.written(self._on_disk)
        return self._latch

    def start(self, written: Written) -> None:
        """Write changes from now on. `written` is called after every write, on the loop, before the answers go out."""
        self._written = written
        if self._store is not None:
            # No group: it goes on until `close`, also while the bridge's tasks fail and a group would cancel it.
            self._writing = asyncio.get_running_loop().create_task(self._run(self._store), name="stop keeper")

    def changed(self) -> None:
        self._wake.set()

    def answer(self, asker: StopAsker, press: str, number: int) -> None:
        """Answer that the press was taken: at once if it is on the disk already or cannot be written."""
        answer, version = StopTaken(press=press, number=number), self._latch.version
        if version == self._on_disk and not self._trouble:
            asker.send(answer)
        elif self._store is None or self._trouble or len(self._waiting) >= MAX_WAITING:
            asker.send(StopTaken(press=press, number=number, kept=False))
        else:
            self._waiting.append(_Waiting(asker, answer, version))

    def note_end(self, reason: str) -> None:
        """Tell the next bridge why this one does not end in order. May be called from any thread.

        Raises:
            OSError: the reason cannot be written.
        """
        if self._store is not None:
            self._store.note_end(reason)

    async def close(self, *, in_order: bool) -> None:
        """Write the changes that are not on the disk yet, and whether the bridge ended in order. Idempotent."""
        store, self._store = self._store, None
        if self._writing is not None:
            self._writing.cancel()
            await asyncio.wait([self._writing])
        if store is None:
            return
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_TIMEOUT):
                if self._on_disk >= 0:  # the directory was opened
                    try:
                        await self._write(store, ended=in_order)
                    except OSError as error:
                        _logger.error("the bridge ends, and the stop is not on the disk: %s", error)
                await self._in_thread(store.close)
        self._thread.shutdown(wait=False)

    async def _run(self, store: StopStore) -> None:
        while True:
            await self._wait(LOOK)
            gone = not await self._in_thread(store.is_there)
            while gone or self._on_disk != self._latch.version:
                version = self._latch.version
                try:
                    await self._write(store, ended=False)
                except OSError as error:
                    self._note(str(error))
                    self._tell(version, str(error))
                    await self._wait(RETRY)
                    continue
                gone = False
                self._note("")
                self._tell(version, "")

    async def _wait(self, seconds: float) -> None:
        """Wait until something may have changed, for at most `seconds`."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._wake.wait()
        self._wake.clear()

    async def _write(self, store: StopStore, *, ended: bool) -> None:
        version, record = self._latch.version, self._latch.record
        if (newest := self._latch.last_number) + RESERVED // 2 >= self._reserved:  # long before the last is given
            self._reserved = await self._in_thread(partial(store.reserve, newest))
        await self._in_thread(partial(store.write, Kept(latch=record, ended=ended)))
        self._on_disk = version

    def _note(self, trouble: str) -> None:
        if trouble and not self._trouble:
            _logger.error("the stop cannot be kept on the disk: %s", trouble)
        elif self._trouble and not trouble:
            _logger.warning("the stop is kept on the disk again")
        self._trouble = trouble

    def _tell(self, version: int, error: str) -> None:
        self._written(version, error)
        ready = [each for each in self._waiting if each.version <= version]
        self._waiting = [each for each in self._waiting if each.version > version]
        for asker, answer, _ in ready:
            asker.send(StopTaken(press=answer.press, number=answer.number, kept=not error))

    async def _in_thread(self, call: Callable[[], Result]) -> Result:
        return await asyncio.get_running_loop().run_in_executor(self._thread, call)
