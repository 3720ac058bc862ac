"""What serves besides may fail: whoever drives goes on, and STOP is heard."""

import errno
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from lockstep.server.composition import robot_app
from lockstep.server.media.sources.source_manager import SourceManager
from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.writing import recorder
from lockstep.server.recording.writing.recorder import Recorder
from lockstep.server.sfu.coordinator import SfuCoordinator
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.talkback.talkback import Talkback
from lockstep.server.telemetry import background
from tests.server.rig import eventually, running_rig


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("recorder", Recorder),
        ("sources", SourceManager),
        ("voice", Talkback),
        ("relays", SfuCoordinator),
        ("kept stops", StopKeeper),
    ],
)
async def test_a_fault_of_a_background_task_is_counted_and_takes_neither_the_session_nor_stop_with_it(
    name: str, kind: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(background, "RESTART_AFTER", 0.01)
    run: Callable[[Any], Awaitable[None]] = kind.run
    runs: list[object] = []

    async def fails_at_first(self: Any) -> None:
        runs.append(self)
        if len(runs) == 1:
            raise RuntimeError("a fault of ours")
        await run(self)

    monkeypatch.setattr(kind, "run", fails_at_first)
    async with running_rig() as rig, rig.peer("observer") as peer:
        await eventually(lambda: len(runs) > 1)
        assert rig.count("lockstep_internal_errors_total", where=name) == 1
        answer = await rig.http.post("/api/stop", headers=rig.token("observer"), json={})
        assert (answer.status_code, answer.json()["delivered"]) == (200, True)
        assert not peer.closed.is_set()


async def test_a_machine_that_gives_no_more_threads_takes_neither_the_session_nor_stop_with_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(background, "RESTART_AFTER", 0.01)
    runs: list[object] = []

    async def fails(ended: object, moving: object) -> None:
        runs.append(ended)
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(robot_app, "sweep_forever", fails)
    async with running_rig() as rig:
        await eventually(lambda: len(runs) > 2)
        answer = await rig.http.post("/api/stop", headers=rig.token("observer"), json={})
        assert (answer.status_code, answer.json()["delivered"]) == (200, True)


async def test_a_disk_whose_recordings_cannot_be_read_any_more_takes_neither_the_session_nor_stop_with_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(recorder, "NEWS_SECONDS", 0.01)
    monkeypatch.setattr(recorder, "PRUNE_TICKS", 2)
    looked: list[RecordingStore] = []

    def unreadable(self: RecordingStore) -> list[Path]:
        looked.append(self)
        raise OSError(errno.EIO, "Input/output error")

    async with running_rig() as rig, rig.peer("observer") as peer:
        monkeypatch.setattr(RecordingStore, "files", unreadable)
        started = await rig.http.post("/api/recordings", headers=rig.token("supervisor"), json={"name": "a"})
        assert started.status_code == 201
        await eventually(lambda: len(looked) > 2)
        listed = await rig.http.get("/api/recordings", headers=rig.token("supervisor"))
        assert (listed.status_code, listed.json()["error"]) == (503, "recording_failed")
        answer = await rig.http.post("/api/stop", headers=rig.token("observer"), json={})
        assert (answer.status_code, answer.json()["delivered"]) == (200, True)
        assert not peer.closed.is_set()
        assert rig.count("lockstep_internal_errors_total", where="recorder") == 0
