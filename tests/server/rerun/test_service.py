"""A driven console whose session goes to Rerun; read and received by Rerun's own library and server."""

import asyncio
import os
import shutil
import signal
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from lockstep.bench.harness.free_port import free_port
from lockstep.protocol.console import SeatRequest
from tests.server.recording.rrd import entities, recording_ids
from tests.server.rig import PATIENCE, Rig, TestPeer, eventually, running_rig

VIEWER = Path(sys.executable).with_name("rerun")  # Rerun's own program, which the wheel brings
END_SECONDS = 10.0  # for the viewer


async def process_of(rig: Rig) -> int:
    """The id of the process for Rerun, once it reads."""
    service = rig.dependencies.rerun
    assert service is not None
    async with asyncio.timeout(PATIENCE):
        await service.running.wait()
    assert service.process_id is not None
    return service.process_id


async def take_seat(peer: TestPeer) -> None:
    await peer.feedback()
    peer.send("session", SeatRequest())
    await peer.drive([0.0, 0.0, 0.0])


async def test_a_driven_session_is_in_the_file_by_event_with_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.rerun.service.END_SECONDS", PATIENCE)  # its priority is low
    path = tmp_path / "a.rrd"
    async with running_rig(rerun={"to": str(path)}) as rig:
        process = await process_of(rig)
        async with rig.peer("operator") as operator:
            await take_seat(operator)
            os.kill(process, signal.SIGTERM)  # as a service manager does with all processes at once
            driven = [await operator.drive([0.1, 0.0, 0.0]) for _ in range(20)]
            assert rig.dependencies.media.is_recorded
        epoch = rig.dependencies.console.clock.epoch
    found = entities(path)
    assert recording_ids(path) == [epoch]
    measured: dict[int, list[list[float]]] = {}  # an event whose robot came to rest has several feedbacks
    for row in found["/axes/measured"].rows:
        measured.setdefault(row["event"], []).append(row["Scalars:scalars"])
    for feedback in driven:
        assert any(values == pytest.approx(feedback.axes) for values in measured[feedback.event])
    assert {feedback.event for feedback in driven} <= set(found["/axes/commanded"].column("event"))
    overview = found["/camera/overview"]
    assert overview.rows[0]["VideoStream:is_keyframe"] == [True]
    assert any("drives" in text for (text,) in found["/log"].column("TextLog:text"))
    assert found["/driver/kind"].column("StateChange:state")[0] == ["human"]


@asynccontextmanager
async def viewer(port: int, path: Path) -> AsyncIterator[None]:
    """Rerun's server, which saves what it gets."""
    process = await asyncio.create_subprocess_exec(
        *(str(VIEWER), "--save", str(path), "--port", str(port), "--bind", "127.0.0.1"),
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.DEVNULL,
        env={**os.environ, "HOME": str(path.parent)},
        start_new_session=True,  # it is a script that starts the viewer: both get the signals
    )
    try:
        async with asyncio.timeout(PATIENCE):
            while True:
                try:
                    _, writer = await asyncio.open_connection("127.0.0.1", port)
                    writer.close()
                    break
                except OSError:
                    await asyncio.sleep(0.05)
        yield
    finally:
        os.killpg(process.pid, signal.SIGINT)
        try:
            async with asyncio.timeout(END_SECONDS):
                await process.wait()
        except TimeoutError:
            os.killpg(process.pid, signal.SIGKILL)  # all that is asserted of its file was read before
            await process.wait()


def seen_so_far(path: Path) -> list[Any]:
    """The events in a file of which the viewer may have written half a chunk."""
    try:
        return entities(path)["/axes/measured"].column("event")
    except Exception:
        return []


@pytest.mark.skipif(shutil.which(str(VIEWER)) is None, reason="the wheel of rerun-sdk brought no viewer")
async def test_a_viewer_that_starts_later_gets_the_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lockstep.server.rerun.service.RETRY_SECONDS", 0.2)
    port, path = free_port(), tmp_path / "seen.rrd"
    async with running_rig(rerun={"to": f"127.0.0.1:{port}"}) as rig, rig.peer("operator") as operator:
        await take_seat(operator)
        before = await operator.drive([0.1, 0.0, 0.0])  # nobody is there
        async with viewer(port, path):
            async with asyncio.timeout(PATIENCE):
                while not path.exists() or b"/axes/measured" not in path.read_bytes():
                    await operator.drive([0.1, 0.0, 0.0])
            last = await operator.drive([0.1, 0.0, 0.0])
            async with asyncio.timeout(PATIENCE):
                while last.event not in seen_so_far(path):
                    await operator.drive([0.1, 0.0, 0.0])
    assert before.event < last.event


async def driven_until_another_process_runs(rig: Rig, operator: TestPeer, ended: int) -> None:
    service = rig.dependencies.rerun
    assert service is not None
    async with asyncio.timeout(PATIENCE):
        while service.process_id in (ended, None):
            await operator.drive([0.1, 0.0, 0.0])


async def test_a_viewer_that_never_reads_and_a_process_that_is_killed_take_nothing_from_who_drives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("lockstep.server.rerun.service.RETRY_SECONDS", 0.1)
    monkeypatch.setattr("lockstep.server.rerun.service.END_SECONDS", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        async with running_rig(rerun={"to": f"127.0.0.1:{listening.getsockname()[1]}"}) as rig:
            killed = await process_of(rig)
            async with rig.peer("operator") as operator:
                await take_seat(operator)
                events = [(await operator.drive([0.1, 0.0, 0.0])).event for _ in range(20)]
                os.kill(killed, signal.SIGKILL)
                await driven_until_another_process_runs(rig, operator, killed)
                events += [(await operator.drive([0.1, 0.0, 0.0])).event for _ in range(20)]
                assert not operator.closed.is_set()
    assert events == sorted(set(events))


async def test_a_process_that_takes_nothing_is_ended_and_another_begins(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("lockstep.server.rerun.service.RETRY_SECONDS", 0.1)
    monkeypatch.setattr("lockstep.server.rerun.service.BLOCKED_SECONDS", 2.0)
    async with running_rig(rerun={"to": str(tmp_path / "a.rrd")}) as rig:
        stopped = await process_of(rig)
        async with rig.peer("operator") as operator:
            await take_seat(operator)
            os.kill(stopped, signal.SIGSTOP)
            await driven_until_another_process_runs(rig, operator, stopped)
            assert not operator.closed.is_set()
        await eventually((tmp_path / "a-2.rrd").exists)


async def test_without_a_word_of_it_there_is_no_process() -> None:
    async with running_rig() as rig:
        assert rig.dependencies.rerun is None
