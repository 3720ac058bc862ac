"""The process that reads recordings: what it answers, and what becomes of it when a file harms it."""

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import msgspec
import pytest

from lockstep.server.errors import (
    NotAllowed,
    NotFound,
    RecordingFailed,
    RecordingUnreadable,
    ShuttingDown,
    TooManyRequests,
)
from lockstep.server.recording.browsing import worker as worker_module
from lockstep.server.recording.browsing.jobs import ListEpisodes, ShowPicture
from lockstep.server.recording.browsing.worker import RecordingWorker
from lockstep.server.recording.episodes.edits import edits_path
from lockstep.server.recording.episodes.episode_list import RecordingEpisodes
from tests.server.recording.makers import SECOND, START, Story
from tests.server.recording.test_episode_export import KEPT_AND_NOT, recording
from tests.waiting import eventually

SECONDS = 60.0
HANGS = (sys.executable, "-c", "import time; time.sleep(1000)")


@pytest.fixture
async def worker() -> AsyncIterator[RecordingWorker]:
    made = RecordingWorker()
    yield made
    await made.close()


def picture(path: Path, event: int = 30, since: int | None = None) -> ShowPicture:
    return ShowPicture(path=str(path), camera="front", event=event, width=160, since=since)


async def test_it_lists_episodes_and_shows_pictures_one_after_the_other_in_one_process(
    tmp_path: Path, worker: RecordingWorker
) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    listed = msgspec.json.decode(await worker.ask(ListEpisodes(str(path)), SECONDS), type=RecordingEpisodes)
    assert [each.state for each in listed.episodes] == ["kept", "discarded", "kept", "cut", "open"]
    assert listed.cameras == ["front"]
    pid = worker.pid
    answers = await asyncio.gather(*(worker.ask(picture(path, event), SECONDS) for event in (20, 30, 40)))
    assert [int.from_bytes(each[:4], "big") for each in answers] == [20, 30, 40]
    assert all(each[4:6] == b"\xff\xd8" for each in answers)
    assert worker.pid == pid


async def test_what_cannot_be_read_is_said_and_the_process_goes_on(tmp_path: Path, worker: RecordingWorker) -> None:
    damaged, fifo, false = tmp_path / "a.mcap", tmp_path / "b.mcap", tmp_path / "c.mcap"
    damaged.write_bytes(b"\x89MCAP0\r\n" + b"\xff" * 100)
    os.mkfifo(fifo)
    Story(events=40).write(false)
    for path, error in (
        (damaged, RecordingUnreadable),
        (fifo, RecordingFailed),
        (tmp_path / "none.mcap", NotFound),
        (false, RecordingUnreadable),
    ):
        with pytest.raises(error):
            await worker.ask(picture(path), SECONDS)
    pid = worker.pid
    good = recording(tmp_path / "d.mcap")
    assert await worker.ask(picture(good), SECONDS)
    with pytest.raises(NotFound):
        await worker.ask(picture(good, 1), SECONDS)
    assert worker.pid == pid


async def test_changes_that_cannot_be_read_leave_the_episodes_as_they_were_recorded(
    tmp_path: Path, worker: RecordingWorker
) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    edits_path(path).symlink_to("/etc/passwd")
    listed = msgspec.json.decode(await worker.ask(ListEpisodes(str(path)), SECONDS), type=RecordingEpisodes)
    assert listed.trouble.startswith("the changes cannot be read")
    assert listed.episodes[0].state == "kept"


async def test_nothing_is_shown_that_was_recorded_before_the_link_was_made(
    tmp_path: Path, worker: RecordingWorker
) -> None:
    path = tmp_path / "a.mcap"
    Story(events=300, real=True).write(path)
    middle = START // SECOND * 1_000_000 + 6_000_000
    with pytest.raises(NotAllowed):
        await worker.ask(picture(path, since=middle + 3_600_000_000), SECONDS)
    with pytest.raises(NotFound):
        await worker.ask(picture(path, 100, since=middle), SECONDS)
    assert await worker.ask(picture(path, 290, since=middle), SECONDS)


async def test_a_process_that_dies_or_hangs_costs_one_job_and_the_next_gets_another(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap")
    worker = RecordingWorker()
    await worker.ask(picture(path), SECONDS)
    pid = worker.pid
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    with pytest.raises(RecordingFailed, match="has failed"):
        await worker.ask(picture(path), SECONDS)
    assert await worker.ask(picture(path), SECONDS)
    assert worker.pid != pid
    with pytest.raises(RecordingFailed, match="too long"):
        await worker.ask(picture(path), 0.0)
    assert worker.pid is None
    assert await worker.ask(picture(path), SECONDS)
    await worker.close()


async def test_a_job_that_nobody_waits_for_any_more_is_not_answered_to_the_next(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap")
    worker = RecordingWorker()
    await worker.ask(picture(path, 20), SECONDS)
    gone = asyncio.ensure_future(worker.ask(picture(path, 30), SECONDS))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    gone.cancel()
    with pytest.raises(asyncio.CancelledError):
        await gone
    assert int.from_bytes((await worker.ask(picture(path, 40), SECONDS))[:4], "big") == 40
    await worker.close()


async def test_only_so_many_jobs_wait_and_closing_ends_the_process() -> None:
    worker = RecordingWorker(HANGS, max_waiting=2)
    waiting = [asyncio.ensure_future(worker.ask(ListEpisodes("x"), SECONDS)) for _ in range(2)]
    await eventually(lambda: worker.pid is not None)
    with pytest.raises(TooManyRequests):
        await worker.ask(ListEpisodes("x"), SECONDS)
    await worker.close()
    first, second = await asyncio.gather(*waiting, return_exceptions=True)
    assert isinstance(first, RecordingFailed)
    assert isinstance(second, ShuttingDown)
    assert worker.pid is None


async def test_while_somebody_drives_the_process_rests_after_each_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = recording(tmp_path / "a.mcap")
    is_driven, rests = False, list[float]()
    real_sleep = asyncio.sleep

    async def sleep(seconds: float) -> None:
        rests.append(seconds)
        await real_sleep(0)

    monkeypatch.setattr(worker_module, "LEAST_REST", 3600.0)
    monkeypatch.setattr(worker_module, "MOST_REST", 7200.0)
    worker = RecordingWorker(is_driven=lambda: is_driven)
    await worker.ask(picture(path, 20), SECONDS)
    await worker.ask(picture(path, 30), SECONDS)
    is_driven = True
    await worker.ask(picture(path, 20), SECONDS)
    monkeypatch.setattr(asyncio, "sleep", sleep)
    await worker.ask(picture(path, 30), SECONDS)
    monkeypatch.undo()
    (rest,) = rests
    assert 0 < rest <= 3600.0
    await worker.close()
