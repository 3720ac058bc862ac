"""Keeps one robot's stops beyond the end of link, session and console. Owns the presses and their files."""

import asyncio
from functools import partial
from pathlib import Path

import structlog

from lockstep.server.stop.stop_presses import Press, StopPresses
from lockstep.server.stop.stop_store import KeptStops, kept_stops_place
from lockstep.server.util.broadcast import Broadcast
from lockstep.server.util.uncancelled import in_thread

__all__ = ["KEPT", "KEPT_IN_MEMORY", "StopKeeper"]

log = structlog.get_logger(__name__)

RETRY_SECONDS = 2.0  # after a write that failed
KEPT = "the stop is kept and sent first when the robot link is back"
KEPT_IN_MEMORY = "the stop is kept until this console ends and sent first when the robot link is back"
WRITE_PATIENCE = 0.5  # s that the sender of a press waits for the disk


class StopKeeper:
    """Keeps stops in memory and on disk. Call `load`, then run `run` as a task.

    All else is called on the loop and returns at once, but for `written`, `kept_words` and `trouble_other_than`.

    Attributes:
        lasts: whether stops that are written outlive this console
        trouble: the reason if stops cannot be written at present, else ""
    """

    def __init__(self, directory: Path, robot: str, *, lasts: bool = True) -> None:
        """`directory`: the robot's, within the state directory. `robot`: the bridge's address.

        `lasts`: whether what is in the directory outlives this console.
        """
        self.presses = StopPresses()
        self.lasts = lasts
        self.trouble = ""
        self._files = KeptStops(kept_stops_place(directory, robot))
        self._wanted: dict[str, Press] = {}  # presses that belong on the disk
        self._written: set[str] = set()
        self._wake = asyncio.Event()
        self._news = Broadcast()  # something was written, or could not be

    async def load(self) -> None:
        """Make the presses that an earlier run has kept pending again."""
        try:
            found = await asyncio.to_thread(self._files.load)
        except OSError as error:
            self._tell(error.strerror or str(error))
            return
        for press in found:
            self.presses.again(press)
            self._wanted[press.id] = press
            self._written.add(press.id)
        if found:
            log.warning("kept stops", count=len(found))

    def keep(self, *presses: Press) -> None:
        """Have `run` write those to disk: the robot cannot be told now."""
        self._wanted.update((press.id, press) for press in presses if self.presses.is_pending(press.id))
        self._wake.set()

    def settled(self, press: str) -> None:
        """Have `run` delete a press: the robot has answered it, or another press has replaced it."""
        if self._wanted.pop(press, None) is not None or press in self._written:
            self._wake.set()

    async def kept_words(self, press: str) -> str:
        """Return how a press is kept, in words for its sender; wait briefly for it to be on the disk."""
        unwritten = await self.written(press)
        if unwritten:
            return f"{KEPT_IN_MEMORY}; the stop is not on the console's disk ({unwritten})"
        return KEPT if self.lasts else f"{KEPT_IN_MEMORY}; the state directory is temporary"

    async def written(self, press: str) -> str:
        """Wait briefly for a kept press to be on the disk; return "", or the reason why it is not."""
        try:
            async with asyncio.timeout(WRITE_PATIENCE):
                while press in self._wanted and press not in self._written and not self.trouble:
                    await self._news.wait()
        except TimeoutError:
            return "the disk has not answered"
        return "" if press not in self._wanted or press in self._written else self.trouble

    async def trouble_other_than(self, known: str) -> str:
        """Wait until `trouble` is not `known`; return it."""
        while self.trouble == known:
            await self._news.wait()
        return self.trouble

    async def run(self) -> None:
        """Keep the disk up to date until cancelled; then write all unanswered presses, whatever the link did."""
        try:
            while True:
                await self._wake.wait()
                self._wake.clear()
                while not await self._settle():  # noqa: ASYNC110 - a disk has no event
                    await asyncio.sleep(RETRY_SECONDS)
        finally:
            self._write_last()

    async def _settle(self) -> bool:
        """Bring the disk up to date; False if that has to be tried again later. One press's failure stops no other."""
        missing = [press for press in self._wanted.values() if press.id not in self._written]
        over = [press for press in self._written if press not in self._wanted]
        trouble = ""
        for press in missing:
            try:
                await in_thread(partial(self._files.keep, press))
            except OSError as error:
                trouble = error.strerror or str(error)
                self._tell(trouble)
            else:
                self._written.add(press.id)
                self._tell(trouble)
        for id_ in over:
            try:
                await in_thread(partial(self._files.drop, id_))
            except OSError as error:
                trouble = error.strerror or str(error)
            else:
                self._written.discard(id_)
        self._tell(trouble)
        return not trouble

    def _write_last(self) -> None:
        """Write unanswered presses. This blocks: nothing else runs any more that a slow disk could hold up."""
        for press in self.presses.pending:
            if press.id not in self._written:
                try:
                    self._files.keep(press)
                except OSError as error:
                    log.error("stops cannot be kept on disk", error="stops_unwritable", detail=str(error))

    def _tell(self, trouble: str) -> None:
        changed, self.trouble = trouble != self.trouble, trouble
        self._news.send()
        if changed and trouble:
            log.error("stops cannot be kept on disk", error="stops_unwritable", detail=trouble)
