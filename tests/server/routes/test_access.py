"""Invitations, revocations and the audit over HTTP, and what becomes of the peers."""

import asyncio
import re
import threading
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import jwt
import pytest

from lockstep.client import Console, SignallingRefused
from lockstep.protocol.console import Notice, Role, SeatTake
from lockstep.protocol.messages import Stop
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.server.auth.invitation_store import InvitationStore
from lockstep.server.auth.invitations import MAX_LIVE, MIN_SECONDS, Invitations
from lockstep.server.routes import access
from lockstep.server.util.state_dir import StateDir, StateDirUnusable
from tests.server.rig import PATIENCE, Rig, TestPeer, eventually, links_that_expire, running_console, running_rig

NOWHERE = 1  # a port where no robot bridge is


async def _invite(rig: Rig, by: Role, **wanted: Any) -> httpx.Response:
    return await rig.http.post("/api/invitations", headers=rig.token(by), json=wanted)


def _bearer(link: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {link.partition('#token=')[2]}"}


async def _kinds(rig: Rig) -> list[str]:
    answer = await rig.http.get("/api/audit?limit=500", headers=rig.token("supervisor"))
    return [record["kind"] for record in answer.json()["records"]]


async def test_an_invitation_gives_a_link_with_its_role_and_name() -> None:
    async with running_console(NOWHERE) as rig:
        answer = await _invite(rig, "operator", role="observer", name="Ada\n", seconds=3600)
        made = answer.json()
        assert answer.status_code == 201
        assert made["link"].startswith(f"{rig.url}/#token=")
        assert (made["role"], made["name"], made["by"], made["revoked"]) == ("observer", "Ada", "operator", False)
        session = await rig.http.get("/api/session", headers=_bearer(made["link"]))
        assert session.json()["you"] == {"role": "observer", "name": "Ada"}
        listed = (await rig.http.get("/api/invitations", headers=rig.token("supervisor"))).json()
        assert [each["id"] for each in listed["invitations"]] == [made["id"]]
        assert listed["may_invite"] == ["observer", "policy", "operator", "supervisor"]
        assert "link" not in listed["invitations"][0]


@pytest.mark.parametrize(
    ("by", "wanted", "status", "error"),
    [
        ("observer", {"role": "observer"}, 403, "not_allowed"),
        ("operator", {"role": "supervisor"}, 403, "not_allowed"),
        ("operator", {"role": "admin"}, 400, "bad_json"),
        ("operator", {"name": "x" * 61}, 400, "bad_json"),
        ("operator", {"seconds": 1}, 422, "bad_parameter"),
        ("supervisor", {"seconds": 1e9}, 422, "bad_parameter"),
        ("supervisor", {"seconds": "long"}, 400, "bad_json"),
    ],
)
async def test_what_is_not_permitted_or_not_understood_is_refused(
    by: Role, wanted: dict[str, Any], status: int, error: str
) -> None:
    async with running_console(NOWHERE) as rig:
        answer = await _invite(rig, by, **wanted)
        assert (answer.status_code, answer.json()["error"]) == (status, error)
        assert rig.dependencies.state.invitations.known.all == []


async def test_observers_see_no_invitations_and_revoke_none_and_only_supervisors_read_the_audit() -> None:
    async with running_console(NOWHERE) as rig:
        for method, path, role in (
            ("GET", "/api/invitations", "observer"),
            ("DELETE", "/api/invitations/x", "observer"),
            ("GET", "/api/audit", "observer"),
            ("GET", "/api/audit", "operator"),
        ):
            answer = await rig.http.request(method, path, headers=rig.token(role))  # type: ignore[arg-type]
            assert (answer.status_code, answer.json()["error"]) == (403, "not_allowed")
            assert (await rig.http.request(method, path)).status_code == 401
        rig.dependencies.console.audit.flush()
        refused = {(each.role, each.what, each.count) for each in rig.dependencies.audit if each.kind == "refusal"}
        assert refused == {
            ("observer", "not_allowed: GET /api/invitations", 1),
            ("observer", "not_allowed: DELETE /api/invitations/{invitation_id}", 1),
            ("observer", "not_allowed: GET /api/audit", 1),
            ("operator", "not_allowed: GET /api/audit", 1),
        }


async def test_of_links_that_have_ended_the_newest_are_listed_and_all_that_are_good(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(access, "MAX_ENDED", 2)
    async with running_console(NOWHERE) as rig:

        def fill(known: Any) -> None:
            now = time.time()
            for number in range(8):
                made = known.invite(None, "observer", f"n{number}", 3600, now + number)
                if number % 2:
                    known.revoke(None, made.id, now)

        rig.dependencies.state.invitations.update(fill)
        listed = (await rig.http.get("/api/invitations", headers=rig.token("supervisor"))).json()["invitations"]
        assert [each["name"] for each in listed] == ["n7", "n6", "n5", "n4", "n2", "n0"]


async def test_there_are_only_so_many() -> None:
    async with running_console(NOWHERE) as rig:

        def fill(known: Any) -> None:
            for _ in range(MAX_LIVE):
                known.invite(None, "observer", "", 3600, time.time())

        rig.dependencies.state.invitations.update(fill)
        answer = await _invite(rig, "operator")
        assert (answer.status_code, answer.json()["error"]) == (409, "too_many_invitations")


async def test_the_audit_names_the_software_and_the_description_and_says_when_that_is_another_one(
    tmp_path: Path,
) -> None:
    seen = []
    for robot in ("planar", "planar", "micromanipulator"):
        async with (
            Bridge(create_robot(robot), BridgeSettings(port=0)) as bridge,
            running_console(bridge.address[1], state_dir=tmp_path) as rig,
        ):
            await rig.dependencies.console.robot.reached.wait()
            seen.append([each for each in rig.dependencies.audit if each.kind in ("start", "epoch")][-2:])
    (start, first), (_, again), (_, other) = seen
    assert start.what.startswith("console ")
    assert "page " in start.detail
    assert "protocol " in start.detail
    assert re.fullmatch("description [0-9a-f]{64}", first.what)
    assert again.what == first.what
    assert "was" not in again.detail
    assert other.what != first.what
    assert other.detail.endswith(f"; was {first.what}")


async def test_a_full_disk_is_said_by_name_and_a_link_ends_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(*_: object) -> None:
        raise StateDirUnusable(Path("state"), "No space left on device")

    async with running_console(NOWHERE) as rig:
        made = (await _invite(rig, "operator")).json()
        monkeypatch.setattr(rig.dependencies.state.directory, "write", full)
        refused = await _invite(rig, "operator")
        assert (refused.status_code, refused.json()["error"]) == (503, "state_unavailable")
        refused = await rig.http.delete(f"/api/invitations/{made['id']}", headers=rig.token("supervisor"))
        assert (refused.status_code, refused.json()["error"]) == (503, "state_unavailable")
        ended = await rig.http.get("/api/session", headers=_bearer(made["link"]))
        assert ended.json()["error"] == "link_revoked"
        listed = (await rig.http.get("/api/invitations", headers=rig.token("supervisor"))).json()["invitations"]
        assert [each["revoked"] for each in listed if each["id"] == made["id"]] == [True]
        monkeypatch.undo()
        assert (await _invite(rig, "operator")).status_code == 201


async def test_a_revocation_that_the_disk_did_not_take_is_written_as_soon_as_it_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.state.console_context.RETRY_SECONDS", 0.01)
    async with running_rig(state_dir=tmp_path) as rig:
        made = (await _invite(rig, "supervisor", role="operator")).json()
        below = await rig.http.post("/api/invitations", headers=_bearer(made["link"]), json={"role": "observer"})
        tried: list[str] = []

        def full(name: str, data: bytes) -> None:
            tried.append(name)
            raise StateDirUnusable(Path("state"), "No space left on device")

        with monkeypatch.context() as disk:
            disk.setattr(rig.dependencies.state.directory, "write", full)
            disk.setattr(rig.dependencies.state.directory, "overwrite", full)  # of the file that is set aside
            answer = await rig.http.delete(f"/api/invitations/{made['id']}", headers=rig.token("supervisor"))
            assert "the link has ended until this console restarts" in answer.json()["detail"]
            assert "nothing was changed" not in answer.json()["detail"]
            await eventually(lambda: len(tried) >= 3)

        def revoked() -> set[str]:
            return {each.id for each in InvitationStore(StateDir(tmp_path)).known.all if each.revoked_at is not None}

        await eventually(lambda: revoked() == {made["id"], below.json()["id"]})
        await eventually(lambda: not rig.dependencies.state.invitations.unwritten)
        said = [each.detail for each in rig.dependencies.audit if each.kind == "revocation"]
        assert made["id"] in said, "who tried, at once"


async def test_a_console_without_a_place_for_its_audit_goes_on_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "audit.lock").mkdir()
    async with running_rig(state_dir=tmp_path) as rig, rig.peer("operator") as peer:
        notice = await peer.until(lambda each: isinstance(each, Notice) and "audit" in each.text)
        assert isinstance(notice, Notice)
        page = (await rig.http.get("/api/audit", headers=rig.token("supervisor"))).json()
        assert page["trouble"]
        assert page["records"][0]["kind"] == "start"


async def test_revoking_closes_the_peers_at_once_and_the_link_says_so_by_name() -> None:
    async with running_rig() as rig, rig.peer("observer") as other:
        made = (await _invite(rig, "operator", role="operator")).json()
        peer = TestPeer()
        try:
            await peer.join(rig, _bearer(made["link"]), ("control", "session", "stop"))
            listed = (await rig.http.get("/api/invitations", headers=rig.token("supervisor"))).json()
            assert listed["invitations"][0]["connected"] == 1
            stranger = await rig.http.delete(f"/api/invitations/{made['id']}", headers=rig.token("operator"))
            assert (stranger.status_code, stranger.json()["error"]) == (404, "not_found")
            await rig.http.delete(f"/api/invitations/{made['id']}", headers=rig.token("supervisor"))
            async with asyncio.timeout(PATIENCE):
                await peer.closed.wait()
        finally:
            await peer.close()
        assert rig.count("lockstep_peers_ended_total", why="link revoked") == 1
        refused = await rig.http.post("/api/stop", headers=_bearer(made["link"]))
        assert (refused.status_code, refused.json()["error"]) == (401, "link_revoked")
        with pytest.raises(SignallingRefused, match="link_revoked"):
            async with Console(made["link"]):
                pass
        assert not other.closed.is_set()
        kinds = await _kinds(rig)
        assert kinds.index("invitation") < kinds.index("revocation") < len(kinds)


class _LateBody:
    """A request whose body comes when it is let go."""

    def __init__(self, rig: Rig, token: dict[str, str], method: str, path: str, body: bytes, kind: str) -> None:
        self._rig, self._method, self._path, self._body = rig, method, path, body
        self._headers = {**token, "Content-Type": kind, "Content-Length": str(len(body))}
        self.begun, self.go_on = asyncio.Event(), asyncio.Event()

    async def answer(self) -> httpx.Response:
        return await self._rig.http.request(
            self._method, self._path, headers=self._headers, content=self._parts(), timeout=PATIENCE
        )

    async def _parts(self) -> AsyncIterator[bytes]:
        yield self._body[:-1]
        self.begun.set()
        await self.go_on.wait()
        yield self._body[-1:]


LATE = [
    ("POST", "/api/invitations", b'{"role": "operator"}', "application/json"),
    ("POST", "/api/recordings", b'{"name": "x"}', "application/json"),
    ("POST", "/api/stop", b'{"reason": "x"}', "application/json"),
    ("POST", "/whep", b"v=0", "application/sdp"),
    ("PATCH", "/whep", b"a=ice-ufrag:other\r\n", "application/trickle-ice-sdpfrag"),
    ("POST", "/api/reset", b'{"number": 1}', "application/json"),
]


@pytest.mark.parametrize(("method", "path", "body", "kind"), LATE, ids=[" ".join(each[:2]) for each in LATE])
async def test_a_request_that_was_begun_before_its_link_was_revoked_has_no_effect_after_that(
    method: str, path: str, body: bytes, kind: str
) -> None:
    async with running_rig() as rig:
        made = (await _invite(rig, "supervisor", role="operator")).json()
        headers = _bearer(made["link"])
        if path == "/whep":
            peer = TestPeer()
            peer.pc.createDataChannel("session")
            offer = (await peer.offer()).encode()
            await peer.close()
            body = offer if method == "POST" else body
        if method == "PATCH":
            answer = await rig.http.post("/whep", content=offer, headers=headers | {"Content-Type": "application/sdp"})
            path, headers["If-Match"] = answer.headers["location"], answer.headers["etag"]
        late = _LateBody(rig, headers, method, path, body, kind)
        async with asyncio.TaskGroup() as tasks:
            asked = tasks.create_task(late.answer())
            await late.begun.wait()
            await eventually(lambda: rig.count("lockstep_bad_input_total") == 0)
            known = len(rig.dependencies.state.invitations.known.all)
            await rig.http.delete(f"/api/invitations/{made['id']}", headers=rig.token("supervisor"))
            late.go_on.set()
        answer = asked.result()
        expected = {(401, "link_revoked")}
        if method == "PATCH":
            expected.add((404, "not_found"))  # its session ends with the link, at the same time
        assert (answer.status_code, answer.json()["error"]) in expected
        assert len(rig.dependencies.state.invitations.known.all) == known
        assert not rig.dependencies.console.clock.stop.stopped
        await eventually(lambda: len(rig.dependencies.console.peers) == 0)


async def test_a_link_that_another_process_has_just_revoked_invites_and_revokes_nobody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(InvitationStore, "refresh", lambda store: [])  # the console has not looked yet
    async with running_console(NOWHERE, state_dir=tmp_path) as rig:
        ann = (await _invite(rig, "supervisor", role="supervisor")).json()
        bob = (await _invite(rig, "supervisor", role="observer")).json()
        beside = InvitationStore(StateDir(tmp_path))
        beside.update(lambda known: known.revoke(None, ann["id"], time.time()))
        for method, path in (("POST", "/api/invitations"), ("DELETE", f"/api/invitations/{bob['id']}")):
            answer = await rig.http.request(method, path, headers=_bearer(ann["link"]))
            assert (answer.status_code, answer.json()["error"]) == (401, "link_revoked"), method
        beside.refresh()
        assert [each.id for each in beside.known.all if each.is_good(time.time())] == [bob["id"]]


async def test_an_expired_link_invites_nobody_though_its_request_began_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    expire = links_that_expire(monkeypatch)
    async with running_console(NOWHERE) as rig:
        late = _LateBody(rig, rig.token_for_an_hour("operator"), *LATE[0])
        async with asyncio.TaskGroup() as tasks:
            asked = tasks.create_task(late.answer())
            await late.begun.wait()
            expire()
            late.go_on.set()
        assert asked.result().json()["error"] == "link_expired"
        assert rig.dependencies.state.invitations.known.all == []


async def test_a_console_writes_down_that_a_link_has_expired(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lockstep.server.state.console_context.CHECK_SECONDS", 0.05)
    store = InvitationStore(StateDir(tmp_path))
    soon = store.update(
        lambda known: known.invite(None, "observer", "x", MIN_SECONDS, store.clock.now() - MIN_SECONDS + 2.0)
    )
    async with running_console(NOWHERE, state_dir=tmp_path):
        wrong = time.time() - 3600

        def next_run() -> float:
            """What time a console takes it for whose clock has gone back meanwhile."""
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("lockstep.server.auth.stored_clock.time.time", lambda: wrong)
                return InvitationStore(StateDir(tmp_path)).clock.now()

        assert next_run() < soon.expires, "its end is not there yet"
        await eventually(lambda: next_run() >= soon.expires)


async def test_while_the_list_of_links_cannot_be_read_nobody_gets_in_and_everybody_can_still_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.peers.token_revocation.UNKNOWN_SECONDS", 1.0)
    async with running_rig(state_dir=tmp_path) as rig, rig.peer("operator") as peer:
        await _invite(rig, "operator")
        good = (tmp_path / "invitations.json").read_bytes()
        rig.dependencies.state.directory.write("invitations.json", b"rubbish")
        await eventually(lambda: bool(rig.dependencies.state.invitations.trouble))
        refused = await rig.http.get("/api/session", headers=rig.token("supervisor"))
        assert (refused.status_code, refused.json()["error"]) == (503, "state_unavailable")
        assert "lockstep_links_unreadable 1.0" in (await rig.http.get("/metrics")).text
        assert (await rig.http.get("/healthz")).json()["status"] == "degraded"
        unready = await rig.http.get("/readyz")
        assert (unready.status_code, unready.json()) == (503, {"ready": False})
        stopped = await rig.http.post("/api/stop", headers=rig.token("observer"))
        assert stopped.status_code == 200
        async with asyncio.timeout(PATIENCE):
            await peer.closed.wait()
        await eventually(lambda: rig.count("lockstep_peers_ended_total", why="links unreadable") == 1)
        rig.dependencies.state.directory.write("invitations.json", good)
        await eventually(lambda: not rig.dependencies.state.invitations.trouble)
        assert (await rig.http.get("/api/session", headers=rig.token("observer"))).status_code == 200
        assert "lockstep_links_unreadable 0.0" in (await rig.http.get("/metrics")).text


async def test_what_another_process_revokes_ends_here_within_seconds_and_is_recorded(tmp_path: Path) -> None:
    async with running_rig(state_dir=tmp_path) as rig, rig.peer("observer") as other:
        beside = InvitationStore(StateDir(tmp_path))
        made = beside.update(lambda known: known.invite(None, "operator", "Ada", 3600, time.time()))
        token = rig.access.sign(made.identity, made.created)
        peer = TestPeer()
        try:
            await peer.join(rig, {"Authorization": f"Bearer {token}"}, ("control", "session", "stop"))
            beside.update(lambda known: known.revoke(None, made.id, time.time()))
            async with asyncio.timeout(PATIENCE):
                await peer.closed.wait()
        finally:
            await peer.close()
        assert not other.closed.is_set()
        records = [each for each in rig.dependencies.audit if each.kind in ("invitation", "revocation")]
        assert [(each.kind, each.who) for each in records] == [
            ("invitation", "command line"),
            ("revocation", "command line"),
        ]


async def test_a_link_that_expires_ends_its_peers_and_says_so_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    expire = links_that_expire(monkeypatch)
    async with running_rig() as rig:
        token = rig.token_for_an_hour("observer")
        peer = TestPeer()
        try:
            await peer.join(rig, token, ("control", "session", "stop"))
            expire()
            async with asyncio.timeout(PATIENCE):
                await peer.closed.wait()
        finally:
            await peer.close()
        assert rig.count("lockstep_peers_ended_total", why="link expired") == 1
        answer = await rig.http.get("/api/session", headers=token)
        assert (answer.status_code, answer.json()["error"]) == (401, "link_expired")


async def test_a_disk_that_hangs_holds_up_the_end_of_no_link(monkeypatch: pytest.MonkeyPatch) -> None:
    expire = links_that_expire(monkeypatch)
    hangs, ends = threading.Event(), threading.Event()

    def hang(store: InvitationStore) -> None:
        hangs.set()
        ends.wait()

    monkeypatch.setattr(InvitationStore, "keep_time", hang)
    async with running_rig() as rig:
        try:
            async with asyncio.timeout(PATIENCE):
                while not hangs.is_set():  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
            peer = TestPeer()
            try:
                await peer.join(rig, rig.token_for_an_hour("observer"), ("control", "session", "stop"))
                expire()
                async with asyncio.timeout(PATIENCE):
                    await peer.closed.wait()
                assert not ends.is_set()
            finally:
                await peer.close()
        finally:
            ends.set()


async def test_a_disk_that_hangs_holds_up_no_revocation(monkeypatch: pytest.MonkeyPatch) -> None:
    hangs, ends = threading.Event(), threading.Event()
    update = InvitationStore.update

    def hang(store: InvitationStore, change: Callable[[Invitations], object]) -> object:
        hangs.set()
        ends.wait()
        return update(store, change)

    async with running_rig() as rig:
        made = (await _invite(rig, "supervisor", role="operator")).json()
        headers = {"Authorization": f"Bearer {made['link'].partition('#token=')[2]}"}
        peer = TestPeer()
        try:
            await peer.join(rig, headers, ("control", "session", "stop"))
            monkeypatch.setattr(InvitationStore, "update", hang)
            revoking = asyncio.create_task(
                rig.http.delete(f"/api/invitations/{made['id']}", headers=rig.token("supervisor"))
            )
            async with asyncio.timeout(PATIENCE):
                await peer.closed.wait()
            assert (await rig.http.get("/api/session", headers=headers)).json()["error"] == "link_revoked"
            assert await asyncio.to_thread(hangs.wait, PATIENCE)
            assert not ends.is_set()
        finally:
            ends.set()
            await peer.close()
        assert (await revoking).status_code == 200
        assert (await rig.http.get("/api/session", headers=headers)).json()["error"] == "link_revoked"


async def test_who_brings_a_token_of_another_console_is_never_told_what_is_wrong_with_it() -> None:
    async with running_console(NOWHERE) as rig:
        claims = {"aud": "lockstep", "exp": 1.0, "iat": 0.0, "role": "operator", "name": "x", "jti": "1"}
        answers = [
            await rig.http.get("/api/session", headers={"Authorization": f"Bearer {token}"})
            for token in ("rubbish", jwt.encode(claims, "not our secret, of thirty-two bytes", "HS256"))
        ]
        assert [(answer.status_code, answer.text) for answer in answers] == [(401, answers[0].text)] * 2
        assert answers[0].json()["error"] == "unauthorized"


async def test_the_audit_has_pages_and_the_event_references() -> None:
    async with running_rig() as rig, rig.peer("supervisor") as peer:
        peer.send("session", SeatTake())
        peer.send("stop", Stop(reason="a person came in"))
        observer = rig.token("observer")
        await eventually(lambda: rig.dependencies.console.clock.stop.stopped)
        for _ in range(20):
            await rig.http.post("/api/stop", headers=observer, json={"press": "0123456789abcdef" * 2})
        await eventually(lambda: any(record.what == "http, again" for record in rig.dependencies.audit))
        headers = rig.token("supervisor")
        page = (await rig.http.get("/api/audit?after=0&limit=2", headers=headers)).json()
        assert [record["n"] for record in page["records"]] == [1, 2]
        rest = (await rig.http.get("/api/audit?after=2&limit=500", headers=headers)).json()
        newest = (await rig.http.get("/api/audit?after=-1&limit=1", headers=headers)).json()
        assert rest["records"][-1]["n"] == newest["records"][0]["n"] == rest["last"]
        assert rest["trouble"] == ""
        older = (await rig.http.get("/api/audit?before=3&limit=500", headers=headers)).json()
        assert older["records"] == page["records"]
        stop = next(record for record in rest["records"] if record["kind"] == "stop")
        assert (stop["who"], stop["role"], stop["detail"]) == ("supervisor", "supervisor", "a person came in")
        assert re.match(r"stop, stop \d+", stop["what"])
        assert stop["event"] >= 1
        assert stop["epoch"] == rig.dependencies.console.clock.epoch
        seat = next(record for record in rest["records"] if record["kind"] == "seat")
        assert (seat["who"], seat["what"]) == ("supervisor", "taken")
        for wrong in ("limit=0", "limit=501", "after=x"):
            assert (await rig.http.get(f"/api/audit?{wrong}", headers=headers)).status_code == 422


async def test_the_audit_goes_on_over_a_restart(tmp_path: Path) -> None:
    for run in (1, 2):
        async with running_console(NOWHERE, state_dir=tmp_path) as rig:
            await rig.http.post("/api/stop", headers=rig.token("observer"), json={"reason": str(run)})
            stops = [record for record in rig.dependencies.audit if record.kind == "stop"]
            assert [record.detail for record in stops] == [str(each) for each in range(1, run + 1)]
    numbers = [record.n for record in rig.dependencies.audit]
    assert numbers == list(range(1, len(numbers) + 1))


async def test_a_disk_that_is_full_stops_nothing_and_everyone_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    async with running_rig() as rig, rig.peer("operator") as peer:
        monkeypatch.setattr("lockstep.server.audit.audit_file.AuditFile.write", full)
        await rig.http.post("/api/stop", headers=rig.token("observer"))
        notice = await peer.until(lambda each: isinstance(each, Notice) and "audit" in each.text)
        assert isinstance(notice, Notice)
        assert "No space left on device" in notice.text
        assert rig.count("lockstep_audit_failing") == 1
        async with rig.peer("observer") as late:
            await late.until(lambda each: each == notice)
        page = (await rig.http.get("/api/audit?after=-1", headers=rig.token("supervisor"))).json()
        assert page["trouble"] == "No space left on device"
        assert any(record["kind"] == "stop" for record in page["records"])
        assert "lockstep_audit_failures_total" in (await rig.http.get("/metrics")).text
        monkeypatch.undo()
        await peer.until(lambda each: isinstance(each, Notice) and each.level == "info")
        assert rig.count("lockstep_audit_failing") == 0


def _contents(directory: Path) -> bytes:
    return b"".join(each.read_bytes() for each in directory.rglob("*") if each.is_file() and each.name != "signing.key")


async def test_no_token_is_ever_logged_or_kept(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    async with running_rig(state_dir=tmp_path) as rig, rig.peer("operator") as peer:
        made = (await _invite(rig, "operator", role="observer")).json()
        await rig.http.get("/api/session", headers=_bearer(made["link"]))
        await rig.http.delete(f"/api/invitations/{made['id']}", headers=rig.token("supervisor"))
        await rig.http.get("/api/session", headers=_bearer(made["link"]))
        peer.send("stop", Stop())
    out, err = capfd.readouterr()
    kept = _contents(tmp_path)
    assert b"eyJ" not in kept
    assert "eyJ" not in out + err
