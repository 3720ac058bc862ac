"""Episodes of recordings over HTTP: who sees and changes what, and what a stale change meets."""

import asyncio
import json
import os
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from lockstep.protocol.console import Role
from lockstep.server.auth.tokens import Identity
from lockstep.server.recording.episodes.edits import edits_path
from lockstep.server.recording.service import EDITS
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.util.rate_limits import RateLimits
from tests.server.recording.makers import INTERVAL, SECOND, START
from tests.server.recording.test_episode_export import KEPT_AND_NOT, recording
from tests.server.rig import Rig, running_rig

PATH = "/api/recordings/one/episodes"


@pytest.fixture
async def rig(tmp_path: Path) -> AsyncIterator[Rig]:
    """A console with one recording."""
    directory = tmp_path / "recordings"
    directory.mkdir()
    recording(directory / "one.mcap", *KEPT_AND_NOT)
    settings = RecordingSettings(directory=directory, free_bytes=0, age_days=100_000)
    async with running_rig(recording=settings) as rig:
        yield rig


def link_made_at(rig: Rig, role: Role, event: int) -> dict[str, str]:
    """The header of a link that was made at the time of that event."""
    made = START / SECOND + (event - 1) * INTERVAL / SECOND
    identity = Identity(role, role, "late", 4e9, issued=made)
    return {"Authorization": f"Bearer {rig.access.sign(identity, made)}"}


async def listed(rig: Rig, headers: dict[str, str], query: str = "") -> dict[str, Any]:
    """The list when all files were read."""
    while True:
        answer = await rig.http.get(f"/api/episodes{query}", headers=headers)
        assert answer.status_code == 200, answer.text
        found: dict[str, Any] = answer.json()
        if not found["pending"]:
            return found


async def change(rig: Rig, headers: dict[str, str], **body: Any) -> httpx.Response:
    return await rig.http.post(PATH, headers=headers, json=body)


def ids(answer: dict[str, Any]) -> list[str]:
    return [each["id"] for each in answer["episodes"]]


async def test_all_roles_see_the_list_and_only_operators_and_supervisors_change_it(rig: Rig) -> None:
    roles: tuple[Role, ...] = ("observer", "operator", "supervisor")
    for role in roles:
        page = await listed(rig, link_made_at(rig, role, 1))
        (found,) = page["recordings"]
        assert (page["pending"], page["older"], page["unreadable"]) == (0, 0, 0)
        assert [each["state"] for each in found["episodes"]] == ["kept", "discarded", "kept", "cut", "open"]
        assert (found["cameras"], found["revision"]) == (["front"], 0)
        assert found["info"]["episodes"] == {"kept": 2, "discarded": 1, "cut": 1, "open": 1}
    refused = await change(rig, link_made_at(rig, "observer", 1), revision=0, episode="a", task="x")
    assert (refused.status_code, refused.json()["error"]) == (403, "not_allowed")
    for revision, role in enumerate(roles[1:]):
        done = await change(rig, link_made_at(rig, role, 1), revision=revision, episode="a", task=f"by {role}")
        assert (done.status_code, done.json()["episodes"][0]["task"]) == (200, f"by {role}"), done.text
    again = await listed(rig, rig.token("supervisor"))
    assert again["recordings"][0]["episodes"][0]["task"] == "by supervisor"


async def test_an_episode_is_relabelled_trimmed_split_merged_discarded_and_all_is_taken_back(rig: Rig) -> None:
    token = rig.token("supervisor")
    steps: list[tuple[dict[str, Any], list[str]]] = [
        ({"episode": "a", "outcome": "failure", "task": "pull"}, ["a", "b", "c", "d", "e"]),
        ({"episode": "c", "first_event": 47, "last_event": 58}, ["a", "b", "c", "d", "e"]),
        ({"episode": "c", "split": 50}, ["a", "b", "edit-3a", "edit-3b", "d", "e"]),
        ({"episode": "edit-3a", "dropped": True}, ["a", "b", "edit-3a", "edit-3b", "d", "e"]),
        ({"undo": 4}, ["a", "b", "edit-3a", "edit-3b", "d", "e"]),
        ({"episode": "edit-3a", "merge": "edit-3b"}, ["a", "b", "edit-6", "d", "e"]),
        ({"undo": 6}, ["a", "b", "edit-3a", "edit-3b", "d", "e"]),
        ({"undo": 3}, ["a", "b", "c", "d", "e"]),
    ]
    for revision, (body, expected) in enumerate(steps):
        done = await change(rig, token, revision=revision, **body)
        assert done.status_code == 200, done.text
        assert (ids(done.json()), done.json()["revision"]) == (expected, revision + 1)
    found = (await rig.http.get(PATH, headers=token)).json()
    assert [each["undone"] for each in found["changes"]] == [False, False, True, True, False, True, False, False]
    episode = found["episodes"][2]
    assert (episode["first_event"], episode["last_event"], episode["events"]) == (47, 58, 11)
    assert (episode["first_bound"], episode["last_bound"]) == (45, 60)
    assert found["changes"][0]["by"] == "supervisor"


async def test_a_change_that_was_made_of_an_older_state_is_refused_with_409(rig: Rig, tmp_path: Path) -> None:
    token = rig.token("supervisor")
    assert (await change(rig, token, revision=0, episode="a", task="x")).status_code == 200
    before = edits_path(tmp_path / "recordings" / "one.mcap").read_bytes()
    stale = await change(rig, token, revision=0, episode="a", task="y")
    assert (stale.status_code, stale.json()["error"]) == (409, "stale_edit")
    for body in (
        {"episode": "b", "dropped": False},  # it was discarded when it was recorded
        {"episode": "a", "last_event": 99},
        {"episode": "a", "split": 10},
        {"episode": "a", "merge": "c"},
        {"episode": "a"},
        {"undo": 9},
        {"episode": "x", "task": "y"},
    ):
        refused = await change(rig, token, revision=1, **body)
        assert (refused.status_code, refused.json()["error"]) == (422, "edit_refused"), body
    assert edits_path(tmp_path / "recordings" / "one.mcap").read_bytes() == before


@pytest.mark.parametrize(
    "body",
    [{"episode": "a"}, {"revision": -1}, {"revision": 0, "outcome": "good"}, {"revision": 0, "task": "x" * 301}, []],
)
async def test_a_body_that_is_no_change_is_refused(rig: Rig, body: object) -> None:
    refused = await rig.http.post(PATH, headers=rig.token("supervisor"), json=body)
    assert (refused.status_code, refused.json()["error"]) == (400, "bad_json")


async def test_a_link_neither_sees_nor_changes_an_episode_from_before_it_was_made(rig: Rig) -> None:
    late = link_made_at(rig, "operator", 30)
    (found,) = (await listed(rig, late))["recordings"]
    assert ids(found) == ["c", "d", "e"]
    for body in ({"episode": "a", "task": "x"}, {"episode": "a", "dropped": True}):
        refused = await change(rig, late, revision=0, **body)
        assert (refused.status_code, refused.json()["error"]) == (403, "not_allowed")
    assert (await change(rig, rig.token("supervisor"), revision=0, episode="a", task="secret")).status_code == 200
    assert "secret" not in (await rig.http.get(PATH, headers=late)).text
    assert (await change(rig, late, revision=1, undo=1)).json()["error"] == "not_allowed"
    assert (await change(rig, late, revision=1, episode="c", task="mine")).status_code == 200
    newest = link_made_at(rig, "operator", 100_000)
    assert (await listed(rig, newest))["recordings"] == []
    assert (await rig.http.get(PATH, headers=newest)).status_code == 403


async def test_a_picture_is_that_of_the_event_and_only_who_may_read_gets_it(rig: Rig) -> None:
    path = "/api/recordings/one/picture?camera=front&event=30&width=320"
    for _ in range(2):  # made, and then kept
        found = await rig.http.get(path, headers=rig.token("supervisor"))
        assert (found.status_code, found.headers["content-type"]) == (200, "image/jpeg")
        assert found.headers["lockstep-event"] == "30"
        assert found.headers["cache-control"] == "no-store"
        assert found.content.startswith(b"\xff\xd8")
    assert (await rig.http.get(path)).status_code == 401
    assert (await rig.http.get(path, headers=link_made_at(rig, "observer", 100_000))).status_code == 403
    for wrong, status in (
        (path.replace("=30", "=1"), 404),
        (path.replace("front", "back"), 404),
        (path.replace("one", "two"), 404),
        (path.replace("=30", "=0"), 422),
        (path.replace("320", "100000"), 422),
    ):
        assert (await rig.http.get(wrong, headers=rig.token("supervisor"))).status_code == status, wrong


@pytest.mark.parametrize("name", ["..%2Fsecret", "%2Fetc%2Fpasswd", "link", "pipe"])
async def test_no_name_leads_out_of_the_directory(rig: Rig, tmp_path: Path, name: str) -> None:
    recording(tmp_path / "secret.mcap", *KEPT_AND_NOT)
    (tmp_path / "recordings" / "link.mcap").symlink_to(tmp_path / "secret.mcap")
    os.mkfifo(tmp_path / "recordings" / "pipe.mcap")
    token = rig.token("supervisor")
    for method, tail, body in (
        ("GET", "episodes", None),
        ("GET", "picture?camera=front&event=30", None),
        ("GET", "report", None),
        ("POST", "episodes", {"revision": 0, "episode": "a", "task": "x"}),
    ):
        answer = await rig.http.request(method, f"/api/recordings/{name}/{tail}", headers=token, json=body)
        assert answer.status_code in (404, 405), (method, tail, answer.text)
    assert len((await listed(rig, token))["recordings"]) == 1
    assert {name for name in os.listdir(tmp_path) if name.endswith(".jsonl")} == set()


async def test_a_hostile_file_in_the_directory_hides_no_other_and_its_text_is_cut(rig: Rig, tmp_path: Path) -> None:
    directory = tmp_path / "recordings"
    (directory / "rubbish.mcap").write_bytes(b"\x89MCAP0\r\n" + os.urandom(5000))
    (directory / "empty.mcap").touch()
    (directory / "one.episodes.jsonl").write_bytes(b"\xff" * 100 + b"\n" + b'{"episode":"a"' + b"[" * 100_000 + b"\n")
    page = await listed(rig, rig.token("supervisor"))
    assert (len(page["recordings"]), page["unreadable"]) == (1, 2)
    assert page["recordings"][0]["revision"] == 2
    assert [each["kind"] for each in page["recordings"][0]["changes"]] == ["unreadable", "unreadable"]
    assert page["recordings"][0]["episodes"][0]["task"] == "push"


async def test_who_knows_the_list_gets_no_copy_of_it_until_it_changes(rig: Rig) -> None:
    token = rig.token("supervisor")
    first = await listed(rig, token)
    same = await listed(rig, token, f"?known={first['version']}")
    assert (same["unchanged"], same["recordings"]) == (True, [])
    await change(rig, token, revision=0, episode="a", task="x")
    assert not (await listed(rig, token, f"?known={first['version']}"))["unchanged"]
    assert (await listed(rig, token, "?skip=1"))["recordings"] == []


async def test_pictures_and_changes_have_a_rate_and_the_change_is_in_the_audit(rig: Rig, tmp_path: Path) -> None:
    token = rig.token("supervisor")
    assert (await change(rig, token, revision=0, episode="a", task="x")).status_code == 200
    records = (await rig.http.get("/api/audit", headers=token)).text
    assert "episode changed" in records
    answers = {(await change(rig, token, revision=0, episode="a", task="x")).status_code for _ in range(EDITS + 20)}
    assert answers == {409, 429}
    object.__setattr__(rig.app.state.recordings, "pictures", RateLimits(0.0, 1))
    path = "/api/recordings/one/picture?camera=front&event=30"
    assert [(await rig.http.get(path, headers=token)).status_code for _ in range(2)] == [200, 429]


@pytest.mark.parametrize("path", ["/api/episodes", "/api/recordings/one/episodes"])
async def test_the_list_has_a_rate_for_each_link(rig: Rig, path: str) -> None:
    object.__setattr__(rig.app.state.recordings, "lists", RateLimits(0.0, 1))
    token, another = rig.token("observer"), rig.token("supervisor")
    answers = [(await rig.http.get(path, headers=each)).status_code for each in (another, another, token)]
    assert answers[:2] == [200, 429]
    assert answers[2] != 429


async def test_a_running_recording_is_listed_with_its_pictures(tmp_path: Path) -> None:
    settings = RecordingSettings(directory=tmp_path / "recordings", free_bytes=0)
    async with running_rig(recording=settings) as rig:
        token = rig.token("supervisor")
        assert (await rig.http.post("/api/recordings", headers=token)).status_code == 201
        found: dict[str, Any] = {}

        # It asks all the time until the first chunk is written.
        object.__setattr__(rig.app.state.recordings, "lists", RateLimits(1e9, 10**9))
        async with rig.peer("operator"):
            while not found.get("recordings") or not found["recordings"][0]["cameras"]:
                found = await listed(rig, token, f"?known={found.get('version', '')}")
            (running,) = found["recordings"]
            assert running["info"]["running"]
            camera, event = running["cameras"][0], running["info"]["last_event"]
            path = f"/api/recordings/{running['info']['id']}/picture?camera={camera}&event={event}"
            shown = await rig.http.get(path, headers=token)
            assert shown.status_code == 200, shown.text
            assert shown.content.startswith(b"\xff\xd8")
        busy = await rig.http.get(f"/api/recordings/{running['info']['id']}/report", headers=token)
        assert busy.json()["error"] == "already_recording"
    assert json.dumps(found)


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("page", "/api/episodes"),
        ("one", PATH),
        ("picture", "/api/recordings/one/picture?camera=front&event=30"),
        ("report", "/api/recordings/one/report"),
    ],
)
async def test_a_link_that_ends_while_its_answer_is_made_gets_none(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, method: str, path: str
) -> None:
    now = time.time()
    ends = now + 1.0
    token = {
        "Authorization": f"Bearer {rig.access.sign(Identity('supervisor', 'late', 'late', ends, issued=now), now)}"
    }
    catalog = rig.app.state.recordings.catalog
    make = getattr(catalog, method)

    async def slowly(*given: Any) -> Any:
        answer = await make(*given)
        await asyncio.sleep(max(0.0, ends - time.time()) + 0.01)  # the jobs of others come first
        return answer

    monkeypatch.setattr(catalog, method, slowly)
    assert (await rig.http.get(path, headers=token)).status_code == 401


async def test_a_link_that_ends_while_its_change_waits_for_a_thread_changes_nothing(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.time()
    ends = now + 1.0
    signed = rig.access.sign(Identity("operator", "late", "late", ends, issued=START / SECOND), now)
    library = rig.app.state.recordings.library
    opened = library.open

    def slowly(recording_id: str) -> Any:
        time.sleep(max(0.0, ends - time.time()) + 0.01)  # a slow disk
        return opened(recording_id)

    monkeypatch.setattr(library, "open", slowly)
    token = {"Authorization": f"Bearer {signed}"}
    assert (await change(rig, token, revision=0, episode="a", task="x")).status_code == 401
    monkeypatch.undo()
    assert (await rig.http.get(PATH, headers=rig.token("supervisor"))).json()["revision"] == 0
