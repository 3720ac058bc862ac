"""Faults of what is written: a disk that is full, an export that is killed, an episode that is discarded late."""

import asyncio
import errno
import json
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from lockstep.bench.episodes.faults.fault_run import SECONDS, FaultRun, following
from lockstep.bench.harness.processes import started
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.client import RecordedEpisodes

__all__ = ["LOW_BYTES", "discard_late", "fill_disk", "kill_export", "leave_free"]

TRIES: Final = 10  # to fill a disk to which others write
LOW_BYTES: Final = 8 << 20  # that are to stay free on the disk


async def kill_export(run: FaultRun) -> None:
    """Kill the export when its files begin to appear, and export again."""
    await run.keep_one()
    await run.console.end()
    root = run.folder / "dataset"
    files = sorted(map(str, (run.folder / "recordings").glob("*.mcap")))
    async with started((LOCKSTEP, "export", *files, "--to", "lerobot", "--out", str(root))) as exporting:
        async with asyncio.timeout(SECONDS):
            while not list(run.folder.glob(".dataset.partial-*/**/*.mp4")):
                if exporting.process.returncode is not None:
                    run.wrong.append("the export ended before it could be killed")
                    return
                await asyncio.sleep(0.005)
        await exporting.kill()
    run.said.append("export killed")
    if root.exists():
        run.wrong.append("a killed export has left a dataset")
    if list(run.folder.glob(".dataset.partial-*")):
        run.said.append("its unfinished files stay in a hidden folder, which the next export removes")


async def fill_disk(run: FaultRun) -> None:
    """Fill the disk while an episode is open."""
    await run.begun()
    ballast = run.folder / "recordings" / "ballast"
    leave_free(ballast, LOW_BYTES + LOW_BYTES // 8 if run.fault == "disk-low" else 64 << 10)
    async with run.driving_on():
        await run.until(lambda state: state.phase == "idle", "the end of the episode")
        await run.refuses_to_keep()
    ballast.unlink()


def leave_free(ballast: Path, left: int) -> None:
    """Write a file that leaves so many bytes free on its disk, to which others may write meanwhile.

    Raises:
        OSError: they took what was to be left every time.
    """
    for attempt in range(1, TRIES + 1):
        with ballast.open("wb") as file:
            free = shutil.disk_usage(ballast.parent).free
            try:
                os.posix_fallocate(file.fileno(), 0, max(1, free - left))
                return
            except OSError as error:
                if error.errno != errno.ENOSPC or attempt == TRIES:
                    raise


async def discard_late(run: FaultRun) -> None:
    """Discard an episode that was kept and appended, and then once more drive one that is kept."""
    async with started(following(run.folder)):  # beside one that follows already, it ends at once
        await run.keep_one()
        late = run.kept.pop().episode
        await _until_live(run, lambda ids: late in ids, "the kept episode")
        async with RecordedEpisodes(run.link) as recorded:
            listed = await recorded.recordings()
            [recording] = [each for each in listed if any(every.id == late for every in each.episodes)]
            await recorded.discard(recording, late)
        await _until_live(run, lambda ids: late not in ids, "the dataset without it")
        run.said.append("a kept episode is discarded, and taken out")
        await run.keep_one()


async def _until_live(run: FaultRun, found: Callable[[list[str]], bool], what: str) -> None:
    """Wait until the dataset that grows has such episodes."""
    notes = run.folder / "live" / "meta" / "lockstep.json"
    try:
        async with asyncio.timeout(SECONDS):
            while True:
                ids: list[str] = []
                with suppress(FileNotFoundError):
                    ids = [each["episode"] for each in json.loads(notes.read_text())["episodes"]]
                if found(ids):
                    return
                await asyncio.sleep(0.1)
    except TimeoutError:
        run.wrong.append(f"there never was {what}")
