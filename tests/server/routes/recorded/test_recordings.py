"""Recordings over HTTP: who may what, and what comes back."""

import asyncio
import json
import os
import threading
import time
from collections import Counter
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import pytest
from starlette.types import Receive, Scope, Send

from lockstep.protocol.console import RecordingState, Role, SeatRequest
from lockstep.server.auth.tokens import Identity
from lockstep.server.http.ending_response import EndingResponse
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.recording_store import RecordingEntry
from lockstep.server.recording.service import READERS, STARTS, RecordingService
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing import recorder
from lockstep.server.settings import Settings
from tests.server.recording.makers import SECOND, START, Story
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


async def test_a_link_reads_nothing_that_was_recorded_before_it_was_made_and_all_of_what_is_read_is_audited(
    tmp_path: Path,
) -> None:
    path = tmp_path / "one.mcap"
    Story(events=200).write(path)
    middle = START // SECOND + 4
    async with running_rig(recording=RecordingSettings(directory=tmp_path, free_bytes=0)) as rig:
        base = "/api/recordings/one"
        for role in ("observer", "operator"):
            newcomer = _issued(rig, role, middle + 1000)
            assert (await rig.http.get("/api/recordings", headers=newcomer)).json()["recordings"] == []
            for request in (base, f"{base}/chunks/0", f"{base}/records?from=1&to=9", f"{base}/file"):
                answer = await rig.http.get(request, headers=newcomer)
                assert (answer.status_code, answer.json()["error"]) == (403, "not_allowed"), request
        assert (await rig.http.post(f"{base}/ticket", headers=newcomer)).status_code == 403
        guest = _issued(rig, "operator", middle)
        (entry,) = (await rig.http.get("/api/recordings", headers=guest)).json()["recordings"]
        index = (await rig.http.get(base, headers=guest)).json()["index"]
        first = min(chunk for _, _, chunk in index["events"])
        assert first > 0
        assert (await rig.http.get(f"{base}/chunks/{first - 1}", headers=guest)).status_code == 403
        allowed = await rig.http.get(f"{base}/chunks/{first}", headers=guest)
        assert (allowed.status_code, allowed.headers["cache-control"]) == (200, "no-store")
        found = await rig.http.get(f"{base}/records?from=1&to=200", headers=guest)
        assert min(head["arrived"] for head, _ in frames(found.content)) >= middle * 1_000_000
        assert (await rig.http.get(f"{base}/file", headers=guest)).status_code == 403, "it began before the link"
        early = _issued(rig, "operator", middle - 1000)
        assert (await rig.http.get(f"{base}/file", headers=early)).status_code == 200
        assert (await rig.http.post(f"{base}/ticket", headers=early)).status_code == 200
        supervisor = rig.token("supervisor")
        assert (await rig.http.get(f"{base}/chunks/0", headers=supervisor)).status_code == 200
        assert (await rig.http.delete(base, headers=supervisor)).status_code == 200
        rig.dependencies.console.audit.flush(beyond=True)
        refused = Counter[str]()
        for each in rig.dependencies.audit:
            if each.kind == "refusal":
                assert each.link
                refused[f"{each.role}, {each.what}"] += each.count
        route = "not_allowed: GET /api/recordings/{recording_id}"
        assert refused == {
            f"observer, {route}": 1,
            f"observer, {route}/chunks/{{number}}": 1,
            f"observer, {route}/records": 1,
            f"observer, {route}/file": 1,
            f"operator, {route}": 1,
            f"operator, {route}/chunks/{{number}}": 2,
            f"operator, {route}/records": 1,
            f"operator, {route}/file": 2,
            "operator, not_allowed: POST /api/recordings/{recording_id}/ticket": 1,
        }
        audit = [each for each in rig.dependencies.audit if each.kind in ("recording", "reading")]
        done = [(each.role, each.what, each.detail) for each in audit if each.kind == "recording"]
        assert done == [*[("operator", "downloaded", "one")] * 2, ("supervisor", "deleted", "one")]
        read = Counter[str]()  # a busy machine needs more than one record of them
        for each in audit:
            if each.kind == "reading" and each.what == "one":
                read[each.role] += each.count
        assert read == {"operator": 3, "supervisor": 1}


@pytest.mark.parametrize("path", ["", "/one", "/one/chunks/0", "/one/records?from=1&to=9", "/one/file"])
async def test_nothing_of_a_recording_is_kept_by_a_browser_whose_link_may_end(path: str, tmp_path: Path) -> None:
    Story(events=20).write(tmp_path / "one.mcap")
    async with running_rig(recording=RecordingSettings(directory=tmp_path, free_bytes=0)) as rig:
        answer = await rig.http.get(f"/api/recordings{path}", headers=rig.token("supervisor"))
        assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-store")


@pytest.mark.parametrize(
    ("verb", "path"),
    [("GET", ""), ("GET", "/one"), ("GET", "/one/chunks/0"), ("POST", "/one/ticket"), ("DELETE", "/one")],
)
async def test_a_link_that_ends_while_it_waits_for_a_thread_gets_and_deletes_nothing(
    verb: str, path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Story(events=20).write(tmp_path / "one.mcap")
    async with running_rig(recording=RecordingSettings(directory=tmp_path, free_bytes=0)) as rig:
        now = time.time()
        ends = now + 1.0
        late = Identity("supervisor", "late", "late", ends, issued=now)
        token = {"Authorization": f"Bearer {rig.access.sign(late, now)}"}
        in_thread = RecordingService.in_thread

        async def slowly(service: RecordingService, work: Any) -> Any:
            def after_others() -> Any:
                time.sleep(max(0.0, ends - time.time()) + 0.01)  # the work of others comes first
                return work()

            return await in_thread(service, after_others)

        monkeypatch.setattr(RecordingService, "in_thread", slowly)
        answer = await rig.http.request(verb, f"/api/recordings{path}", headers=token)
        assert answer.status_code == 401
        assert (tmp_path / "one.mcap").exists()


async def test_what_is_sent_for_long_ends_with_its_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ends: list[tuple[str, str]] = []

    class Watched(EndingResponse):
        async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
            ends.append((scope["path"].rpartition("/")[2], self.right.token_id))
            await super().__call__(scope, receive, send)

    monkeypatch.setattr("lockstep.server.routes.recorded.recordings.EndingResponse", Watched)
    Story(events=20).write(tmp_path / "one.mcap")
    async with running_rig(recording=RecordingSettings(directory=tmp_path, free_bytes=0)) as rig:
        headers, base = _issued(rig, "operator", START // SECOND - 1000), "/api/recordings/one"
        link = rig.access.bearer(headers["Authorization"]).token_id
        ticket = (await rig.http.post(f"{base}/ticket", headers=headers)).json()["path"]
        assert (await rig.http.get(ticket)).status_code == 200
        for path in (f"{base}/file", f"{base}/records?from=1&to=9"):
            answer = await rig.http.get(path, headers=headers)
            assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-store")
        part = await rig.http.get(f"{base}/file", headers=headers | {"Range": "bytes=8-"})
        assert part.status_code == 206
    assert ends == [(each, link) for each in ("file", "file", "records", "file")]


async def test_who_starts_and_ends_a_recording_is_audited_and_an_automatic_one_ends_only_from_the_seat(
    tmp_path: Path,
) -> None:
    settings = RecordingSettings(directory=tmp_path, free_bytes=0, automatic=True)
    async with running_rig(recording=settings) as rig, rig.peer("operator") as peer:
        recorder = rig.dependencies.recorder
        await eventually(lambda: recorder.state().state == "recording")
        refused = await rig.http.post("/api/recordings/stop", headers=rig.token("operator"))
        assert (refused.status_code, refused.json()["error"]) == (403, "not_allowed")
        assert recorder.state().state == "recording"
        peer.send("session", SeatRequest())
        await eventually(lambda: bool(rig.dependencies.console.seat.state.holder))
        assert (await rig.http.post("/api/recordings/stop", headers=rig.token("operator"))).status_code == 403
        assert (await rig.http.post("/api/recordings/stop", headers=peer.headers)).json()["state"] == "off"
        started = (await rig.http.post("/api/recordings", headers=rig.token("operator"))).json()["recording"]
        assert (await rig.http.post("/api/recordings/stop", headers=rig.token("operator"))).status_code == 200
        audit = [each for each in rig.dependencies.audit if each.kind == "recording"]
        assert [(each.role, each.what) for each in audit] == [
            ("", "started by itself"),
            *[("operator", "ended"), ("operator", "started"), ("operator", "ended")],
        ]
        assert [each.detail for each in audit[2:]] == [started, started]


def _issued(rig: Rig, role: Role, at: float) -> dict[str, str]:
    """A link that was made at that time, s since 1970."""
    identity = Identity(role, role, f"{role}-{at}", time.time() + 3600)
    return {"Authorization": f"Bearer {rig.access.sign(identity, at)}"}


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
        observer = _issued(rig, "observer", 0.0)
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


async def test_a_recording_whose_end_the_disk_does_not_take_is_told_as_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = {"recording": RecordingSettings(directory=tmp_path / "recordings", free_bytes=0)}
    async with running_rig(**settings) as rig, rig.peer("observer", "session") as peer:
        operator, library = rig.token("operator"), rig.app.state.recordings.library
        await rig.http.post("/api/recordings", headers=operator)
        await eventually(lambda: bool(library.entries()))

        def full(descriptor: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "fdatasync", full)
        stopped = (await rig.http.post("/api/recordings/stop", headers=operator)).json()
        assert (stopped["state"], stopped["detail"]) == ("failed", "No space left on device")
        await peer.until(lambda each: isinstance(each, RecordingState) and each.state == "failed")
        again = (await rig.http.post("/api/recordings/stop", headers=operator)).json()
        assert (again["state"], again["detail"]) == ("off", ""), "it was told"


async def test_many_who_read_recordings_on_a_disk_that_hangs_hold_up_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running_rig(recording=RecordingSettings(directory=tmp_path, free_bytes=0)) as rig:
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(READERS))
        waiting, hangs = threading.Semaphore(0), threading.Event()

        def entries() -> list[RecordingEntry]:
            waiting.release()
            hangs.wait()
            return []

        monkeypatch.setattr(rig.app.state.recordings.library, "entries", entries)
        asked = [asyncio.create_task(rig.http.get("/api/recordings", headers=rig.token("observer"))) for _ in range(10)]
        try:
            for _ in range(READERS):
                await eventually(lambda: waiting.acquire(blocking=False))
            made = await rig.http.post("/api/invitations", headers=rig.token("operator"), json={"role": "observer"})
            assert made.status_code == 201, "it was written to its own disk, in a thread of its own"
            assert not any(each.done() for each in asked)
        finally:
            hangs.set()
        assert {(await each).status_code for each in asked} == {200}


async def test_the_list_has_pages_and_says_how_much_is_left_out(tmp_path: Path) -> None:
    for number in range(5):
        Story(events=2).write(tmp_path / f"{number}.mcap")
    async with running_rig(recording=RecordingSettings(directory=tmp_path, free_bytes=0)) as rig:
        supervisor = rig.token("supervisor")
        library = rig.app.state.recordings.library
        entries = [msgspec.structs.replace(each, started=number + 1) for number, each in enumerate(library.entries())][
            ::-1
        ]
        library.entries = lambda: entries

        async def page(**query: int) -> tuple[list[int], int]:
            answer = (await rig.http.get("/api/recordings", headers=supervisor, params=query)).json()
            return [each["started"] for each in answer["recordings"]], answer["older"]

        assert await page() == ([5, 4, 3, 2, 1], 0)
        assert await page(limit=2) == ([5, 4], 3)
        assert await page(limit=2, before=4) == ([3, 2], 1)
        assert await page(limit=2, before=2) == ([1], 0)
        refused = await rig.http.get("/api/recordings", headers=supervisor, params={"limit": 501})
        assert (refused.status_code, refused.json()["error"]) == (422, "bad_parameter")


async def test_a_link_begins_only_so_many_recordings_and_others_go_on(rig: Rig) -> None:
    operator, supervisor = rig.token("operator"), rig.token("supervisor")
    for _ in range(STARTS):
        assert (await rig.http.post("/api/recordings", headers=operator)).status_code in (201, 409)
    refused = await rig.http.post("/api/recordings", headers=operator)
    assert (refused.status_code, refused.json()["error"]) == (429, "too_many_requests")
    assert (await rig.http.post("/api/recordings", headers=supervisor)).status_code == 409
    assert (await rig.http.post("/api/recordings/stop", headers=operator)).status_code == 200


async def test_what_records_by_itself_and_fails_does_not_begin_again_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "RETRY_SECONDS", 1e9)
    settings = RecordingSettings(directory=tmp_path, automatic=True, free_bytes=10**18)
    async with running_rig(recording=settings) as rig, rig.peer("observer", "session") as peer:

        def failures() -> list[str]:
            return [each.what for each in rig.dependencies.audit if each.kind == "recording" and each.what == "failed"]

        await peer.until(lambda each: isinstance(each, RecordingState) and each.state == "failed")
        await eventually(lambda: len(failures()) == 1)
        await rig.http.post("/api/recordings", headers=rig.token("operator"))
        await eventually(lambda: len(failures()) >= 2)
        begun = [each.what for each in rig.dependencies.audit if each.kind == "recording" and "started" in each.what]
        assert begun == ["started by itself", "started"]
        assert not [each for each in os.listdir(tmp_path) if each.endswith(".mcap")]
