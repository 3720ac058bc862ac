"""A background task runs again after a fault, and ends when it is done."""

import asyncio

import pytest

from lockstep.server.telemetry import background
from lockstep.server.telemetry.background import keep_running
from lockstep.server.telemetry.metrics import Metrics
from tests.server.rig import PATIENCE


async def test_a_task_that_fails_is_counted_and_runs_again_until_it_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background, "RESTART_AFTER", 0.0)
    metrics, runs = Metrics(process=False), list[int]()

    async def fails_twice() -> None:
        runs.append(len(runs))
        if len(runs) < 3:
            raise RuntimeError("a fault of the console's own")

    async with asyncio.timeout(PATIENCE):
        await keep_running("side", fails_twice, metrics.faults)
    assert runs == [0, 1, 2]
    assert metrics.registry.get_sample_value("lockstep_internal_errors_total", {"where": "side"}) == 2
