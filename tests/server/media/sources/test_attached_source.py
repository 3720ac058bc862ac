"""A source's process, as the console sees it."""

import asyncio
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from lockstep.server.media.sources import attached_source
from lockstep.server.media.sources.attached_source import COMMAND, AttachedSource
from lockstep.server.media.sources.source_url import parse_source
from lockstep.server.media.sources.source_wire import Captured
from tests.server.media.sources.media_files import film
from tests.waiting import PATIENCE


class Watched:
    """A running source and what it did."""

    def __init__(self, text: str, command: tuple[str, ...] = COMMAND) -> None:
        self.media: list[Captured] = []
        self.states: list[str] = []
        self.failures: list[str] = []
        self._news = asyncio.Event()
        self.source = AttachedSource(parse_source("video", text), self._capture, self._change, self._fail, command)

    def _capture(self, medium: Captured) -> None:
        self.media.append(medium)
        self._news.set()

    def _change(self) -> None:
        self.states.append(self.source.state)
        self._news.set()

    def _fail(self, reason: str) -> None:
        self.failures.append(reason)
        self._news.set()

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not condition():
                self._news.clear()
                await self._news.wait()


@asynccontextmanager
async def watching(text: str, command: tuple[str, ...] = COMMAND) -> AsyncIterator[Watched]:
    watched = Watched(text, command)
    task = asyncio.create_task(watched.source.run())
    try:
        yield watched
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def test_a_source_becomes_live_and_comes_back_when_what_it_reads_does(tmp_path: Path) -> None:
    path = tmp_path / "film.avi"
    async with watching(f"file:{path}") as watched:
        await watched.until(lambda: watched.source.state == "reconnecting")
        assert watched.source.detail == "no such file or directory"
        film(tmp_path / "other.avi", "mjpeg").rename(path)
        await watched.until(lambda: len(watched.media) > 3)
        assert watched.source.state == "live"
        assert watched.states == ["reconnecting", "live"]
        assert set(watched.failures) == {"not_found"}


async def test_a_process_that_dies_is_started_again(tmp_path: Path) -> None:
    command = (sys.executable, "-c", "import sys; sys.stdin.buffer.readline()")
    async with watching("file:x", command) as watched:
        await watched.until(lambda: len(watched.failures) >= 2)
        assert watched.failures[0] == "died"
        assert watched.source.detail == "the source's process ended"


@pytest.mark.parametrize("said", ["b'\\xff\\xff\\xff\\xff'", "b'\\0\\0\\0\\2\\xc1\\xc1'", "b'\\0\\0\\0\\x10short'"])
async def test_a_process_that_makes_no_sense_is_ended_and_started_again(said: str) -> None:
    command = (sys.executable, "-c", f"import sys; sys.stdout.buffer.write({said})")
    async with watching("file:x", command) as watched:
        await watched.until(lambda: len(watched.failures) >= 1)
        assert watched.media == []


async def test_a_process_that_hangs_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attached_source, "PATIENCE", 0.5)
    async with watching("file:x", (sys.executable, "-c", "import time; time.sleep(600)")) as watched:
        await watched.until(lambda: watched.failures == ["hung"])
