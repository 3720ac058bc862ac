"""A bench for STOP, whose background tasks run."""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from lockstep.server.control.stop import stop_service
from tests.server.control.stop.stop_bench import StopBench


@pytest.fixture
async def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[StopBench]:
    monkeypatch.setattr(stop_service, "PRESS_RATE", 1e-6)  # a link gets no further press, however slow the machine is
    made = StopBench(tmp_path)
    parts = (made.keeper.run, made.service.run, made.disk.run, made.resets.run)
    tasks = [asyncio.create_task(part()) for part in parts]
    yield made
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
