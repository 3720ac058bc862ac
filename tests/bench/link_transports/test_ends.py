"""Both ends on loopback, by each transport: that commands are answered and pictures arrive, and not how fast."""

import asyncio
import datetime
import shutil
from pathlib import Path

import pytest

from lockstep.bench.harness.free_port import free_port
from lockstep.bench.link_transports import ends
from lockstep.bench.link_transports.ends import CHAIN, KEY, run_console, run_robot
from lockstep.bench.link_transports.messages import framed, picture_bytes, take_frames
from lockstep.bench.link_transports.transports import KINDS, Kind
from lockstep.server.http.transport.tls import self_signed
from tests.waiting import PATIENCE


@pytest.mark.parametrize("kind", KINDS)
async def test_commands_are_answered_and_pictures_arrive(
    kind: Kind, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ends, "WARM_UP", 0.0)
    made = self_signed(tmp_path, {"127.0.0.1"}, datetime.datetime.now(datetime.UTC))
    shutil.copy(made.chain, tmp_path / CHAIN)
    shutil.copy(made.key, tmp_path / KEY)
    port = free_port()
    async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as tasks:
        listening = asyncio.Event()
        console = tasks.create_task(run_console(kind, "127.0.0.1", port, tmp_path, 1.0, listening.set))
        await listening.wait()
        robot = tasks.create_task(run_robot(kind, "127.0.0.1", port, tmp_path))
        found = await console
        robot.cancel()
    assert len(found["trips"]) >= 5
    assert len(found["pictures"]) >= 5
    assert min(found["trips"]) > 0


def test_messages_are_cut_out_whole() -> None:
    waiting = bytearray(framed(1, 200) + framed(2, 50)[:30])
    (message,) = take_frames(waiting)
    assert (message.number, message.size, len(waiting)) == (1, 200, 30)


def test_a_second_of_pictures_is_the_rate_and_a_keyframe_is_larger() -> None:
    assert sum(map(picture_bytes, range(100))) * 8 / 4 == pytest.approx(500_000, rel=0.01)
    assert picture_bytes(100) > 5 * picture_bytes(101)
