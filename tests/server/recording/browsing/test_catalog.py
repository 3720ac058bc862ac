"""What a hostile recording can make the console's own process do."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import pytest

from lockstep.server.errors import ConsoleError, RecordingFailed, RecordingUnreadable
from lockstep.server.recording.browsing.catalog import (
    MAX_LIST_BYTES,
    MOST_RETRY_SECONDS,
    RETRY_SECONDS,
    EpisodeCatalog,
)
from lockstep.server.recording.browsing.worker import RecordingWorker
from lockstep.server.recording.episodes.episode_list import RecordingEpisodes
from lockstep.server.recording.library import Library
from lockstep.server.recording.recording_store import RecordingEntry
from lockstep.server.recording.rights import RecordingReaderRight

INFO = RecordingEntry(
    id="hostile",
    recording="hostile",
    part=1,
    name="",
    robot="planar",
    epoch="e",
    by="",
    started=1,
    ended=2,
    first_event=1,
    last_event=2,
    bytes=1,
    marks={},
    lost=0,
    running=False,
    interrupted=False,
)


class Worker:
    """Answers each job with the same text, or error."""

    def __init__(self, answer: bytes | ConsoleError) -> None:
        self.answer = answer
        self.asked = 0

    async def ask(self, job: object, seconds: float) -> bytes:
        self.asked += 1
        if isinstance(self.answer, ConsoleError):
            raise self.answer
        return self.answer

    async def close(self) -> None: ...


async def _in_thread(work: Callable[[], Any]) -> Any:
    return work()


async def test_a_list_that_would_take_the_loop_long_to_parse_counts_as_unreadable_and_is_not_asked_for_again(
    tmp_path: Path,
) -> None:
    path = tmp_path / "hostile.mcap"
    path.touch()
    library = SimpleNamespace(files=lambda: [path], running=lambda: None)
    listed = RecordingEpisodes(info=INFO, cameras=[], revision=0, changes=[], episodes=[])
    worker = Worker(msgspec.json.encode(listed) + b" " * MAX_LIST_BYTES)
    catalog = EpisodeCatalog(cast(Library, library), _in_thread, cast(RecordingWorker, worker))
    try:
        for _ in range(2):
            page = await catalog.page(RecordingReaderRight("supervisor", None))
            assert (page.unreadable, page.recordings) == (1, [])
        assert worker.asked == 1
    finally:
        await catalog.close()


async def test_a_list_that_took_too_long_is_tried_again_later_and_less_and_less_often(tmp_path: Path) -> None:
    path = tmp_path / "long.mcap"
    path.touch()
    library = SimpleNamespace(files=lambda: [path], running=lambda: None, path=lambda id: path)
    worker, now = Worker(RecordingFailed("reading it takes too long")), [1000.0]
    catalog = EpisodeCatalog(cast(Library, library), _in_thread, cast(RecordingWorker, worker), lambda: now[0])
    right = RecordingReaderRight("supervisor", None)
    waits = []
    try:
        for _ in range(8):
            assert (await catalog.page(right)).unreadable == 1
            before, asked = now[0], worker.asked
            while worker.asked == asked:
                now[0] += RETRY_SECONDS / 2
                with pytest.raises(RecordingUnreadable):
                    await catalog.one("long", right)
            waits.append(now[0] - before)
        assert waits == [min(RETRY_SECONDS * 2**tries, MOST_RETRY_SECONDS) for tries in range(8)]
        listed = RecordingEpisodes(info=INFO, cameras=[], revision=0, changes=[], episodes=[])
        worker.answer = msgspec.json.encode(listed)
        now[0] += MOST_RETRY_SECONDS
        assert (await catalog.one("long", right)).info == INFO
        asked = worker.asked
        now[0] += 10 * MOST_RETRY_SECONDS
        assert len((await catalog.page(right)).recordings) == 1
        assert worker.asked == asked
    finally:
        await catalog.close()
