"""Recordings over HTTP: who may what, and what comes back."""

import json
from collections.abc import AsyncIterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from server.recording.reader import RecordingReader
from server.recording.settings import RecordingSettings
from server.settings import Settings
from tests.server.recording.makers import Story
from tests.server.rig import Rig, eventually, running_rig


@pytest.fixture
async def rig() -> AsyncIterator[Rig]:
    async with running_rig() as rig:
        yield rig


def frames(body: bytes) -> list[tuple[dict[str, Any], bytes]]:
    found, at = [], 0
    while at < len(body):
        length = int.from_bytes(body[at : at + 4], "big")
        head = json.loads(body[at + 4 : at + 4 + length])
        at += 4 + length
        found.append((head, body[at : at + head["size"]]))
        at += head["size"]
    return found


async def test_a_session_is_recorded_read_by_event_downloaded_and_deleted_by_role(tmp_path: Path) -> None:
    settings = {"recording": RecordingSettings(directory=tmp_path / "recordings", free_bytes=0)}
    async with running_rig(**settings) as rig:
        operator, observer, supervisor = rig.token("operator"), rig.token("observer"), rig.token("supervisor")
        assert (await rig.http.post("/api/recordings", headers=observer)).status_code == 403
        started = await rig.http.post("/api/recordings", headers=operator, json={"name": "first"})
        assert (started.status_code, started.json()["state"]) == (201, "recording")
        assert (await rig.http.post("/api/recordings", headers=operator)).json()["error"] == "already_recording"

        library = rig.app.state.recordings.library
        await eventually(lambda: bool(library.entries()))
        running = (await rig.http.get("/api/recordings", headers=observer)).json()["recordings"][0]
        assert running["running"]
        path = f"/api/recordings/{running['id']}"
        assert (await rig.http.delete(path, headers=supervisor)).json()["error"] == "already_recording"
        assert (await rig.http.post("/api/recordings/stop", headers=observer)).status_code == 403
        assert (await rig.http.post("/api/recordings/stop", headers=operator)).json()["state"] == "off"

        details = (await rig.http.get(path, headers=observer)).json()
        assert details["info"]["name"] == "first"
        assert details["description"]["name"] == "planar"
        event = details["index"]["first_event"]
        chunk = frames((await rig.http.get(f"{path}/chunks/0", headers=observer)).content)
        assert chunk[0][0]["topic"] == "/lockstep/robot"
        found = await rig.http.get(f"{path}/records", headers=observer, params={"from": event, "to": event})
        assert any(
            head["topic"] == "/lockstep/feedback" and head["event"] == event for head, _ in frames(found.content)
        )

        assert (await rig.http.post(f"{path}/ticket", headers=observer)).status_code == 403
        assert (await rig.http.get(f"{path}/file", headers=observer)).status_code == 403
        ticket = (await rig.http.post(f"{path}/ticket", headers=operator)).json()["path"]
        part = await rig.http.get(ticket, headers={"Range": "bytes=0-7"})
        assert (part.status_code, part.content) == (206, b"\x89MCAP0\r\n")
        assert (await rig.http.get(f"{path}/file")).status_code == 401
        assert (await rig.http.get(ticket.replace(running["id"], "other"))).status_code == 401
        assert (await rig.http.delete(path, headers=operator)).status_code == 403
        assert (await rig.http.delete(path, headers=supervisor)).json()["recordings"] == []
        assert (await rig.http.get(path, headers=observer)).status_code == 404


async def test_a_directory_that_cannot_be_used_is_told_and_shown_as_failed(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no directory")
    async with running_rig(recording=RecordingSettings(directory=tmp_path / "file" / "recordings")) as rig:
        refused = await rig.http.post("/api/recordings", headers=rig.token("operator"))
        assert (refused.status_code, refused.json()["error"]) == (503, "recording_failed")
        state = (await rig.http.get("/api/recordings", headers=rig.token("observer"))).json()["state"]
        assert state["state"] == "failed"


@pytest.mark.parametrize("path", ["/api/recordings/none", "/api/recordings/none/chunks/0", "/api/recordings/..%2Fkey"])
async def test_what_is_not_there_is_not_found(rig: Rig, path: str) -> None:
    assert (await rig.http.get(path, headers=rig.token("observer"))).status_code == 404


async def test_a_range_that_is_none_is_refused(rig: Rig) -> None:
    query = {"from": 5, "to": 1}
    answer = await rig.http.get("/api/recordings/none/records", headers=rig.token("observer"), params=query)
    assert (answer.status_code, answer.json()["error"]) == (422, "bad_parameter")


def test_the_settings_of_recordings_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOCKSTEP_RECORDING__FILE_BYTES", "5000000")
    assert Settings().recording.file_bytes == 5_000_000


async def test_a_damaged_part_and_a_deleted_file_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "recordings" / "one.mcap"
    path.parent.mkdir()
    Story(events=200).write(path)
    with RecordingReader(path) as reader:
        offset = reader.index.chunks[1].offset
    async with running_rig(recording=RecordingSettings(directory=path.parent, free_bytes=0)) as rig:
        observer = rig.token("observer")
        details = await rig.http.get("/api/recordings/one", headers=observer)
        assert details.headers["content-encoding"] == "gzip"
        times = [arrived for _, arrived, _ in details.json()["index"]["events"]]
        assert len(times) == 8
        assert all(later - earlier >= 1_000_000 for earlier, later in pairwise(times))
        data = bytearray(path.read_bytes())
        data[offset + 500] ^= 1
        path.write_bytes(data)
        broken = await rig.http.get("/api/recordings/one/chunks/1", headers=observer)
        assert (broken.status_code, broken.json()["error"]) == (422, "recording_damaged")
        assert (await rig.http.get("/api/recordings/one/chunks/2", headers=observer)).status_code == 200
        path.unlink()
        assert (await rig.http.get("/api/recordings/one/chunks/2", headers=observer)).status_code == 404
