"""A small crowd of every kind against a real console: who drives goes on, every refusal has a name, nobody is kept.

What the operator's latency is among a hundred is a figure, not a test: `lockstep hostile`.
"""

import asyncio
import sys

import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import Stack, running_stack
from lockstep.bench.hostile.crowd import KINDS
from lockstep.bench.hostile.run import memory_of
from lockstep.client import Console

SECONDS = 240.0  # a busy machine; never waited for in full
LAST_SECONDS = 30.0  # of these, in which the test says what was not refused
MEMORY = 150.0  # MiB that the crowd may cost: 60 peers that have not connected yet, and the encoders of one more tier
# Each follows from one request. A flood is one only on a quick machine: tests/server/peers has that of messages.
NAMED = [("http", "unauthorized"), ("http", "too_large"), ("http", "not_allowed")]


@pytest.mark.timeout(300)
async def test_an_operator_drives_on_among_peers_that_misbehave(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {
        "PEER_CONNECT_TIMEOUT": 5,
        "PEER_SILENCE": 60,
        "SEAT_TIMEOUT": 60,
        "SCENE": 0,
        "WHIP": "phone",
    }.items():
        monkeypatch.setenv(f"LOCKSTEP_{name}", str(value))
    async with (
        running_stack("planar", is_secured=True) as stack,
        Console(stack.operator, video=1, audio=False, silence_seconds=60) as console,
        Console(stack.observer, video=False, audio=False, silence_seconds=60) as bystander,
    ):
        await console.take_seat()
        rest = [0.0] * len(console.description.axes)
        first = last = await drive_on(console, rest)
        memory = memory_of(stack.console)
        arguments = (stack.observer, stack.operator, stack.bridge.address, str(len(KINDS)), "1")
        command = (sys.executable, "-m", "lockstep.bench.hostile.crowd", *arguments)
        async with asyncio.timeout(SECONDS) as wait:
            async with running_process(*command) as (crowd, _):
                while missing := await _not_yet_refused(stack):
                    assert (wait.when() or 0.0) - asyncio.get_running_loop().time() > LAST_SECONDS, missing
                    for _ in range(5):
                        last = await drive_on(console, rest)
                said = await crowd.ask("", SECONDS)
            async for feedback in bystander.feedbacks():
                if feedback.event >= last.event:
                    break
            await _only_two_are_left(stack)
        assert last.event > first.event
        assert console.seat.holder == console.peer, "nobody else has got the seat"
        assert not last.stop.stopped
        metrics = await stack.metrics()
        assert not metrics.values("lockstep_internal_errors_total", "where")
        assert set(said["attempts"]) == {kind.__name__ for kind in KINDS}
        assert not {"500", "http_error"} & said["seen"].keys(), said["seen"]
        assert memory_of(stack.console) - memory < MEMORY


async def _not_yet_refused(stack: Stack) -> set[tuple[str, str]]:
    """Where, and by what name."""
    metrics = await stack.metrics()
    found = {each: metrics.values("lockstep_bad_input_total", "reason", where=each[0]).get(each[1]) for each in NAMED}
    found["refusals", "no_seat"] = metrics.values("lockstep_refusals_total", "reason").get("no_seat")
    return {each for each, count in found.items() if not count}


async def _only_two_are_left(stack: Stack) -> None:
    while sum((await stack.metrics()).values("lockstep_peers", "role").values()) > 2:  # noqa: ASYNC110
        await asyncio.sleep(0.2)
