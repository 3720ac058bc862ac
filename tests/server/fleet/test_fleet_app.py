"""A console with several robots, over HTTP and with peers."""

import asyncio
import contextlib
import json
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from robot_bridge.protocol.console import Participants, Seat, SeatRequest, Welcome
from robot_bridge.protocol.messages import Command, Stop, StopState
from robot_bridge.protocol.serial import event_after
from server.fleet.tiles import FAILED, UNREADABLE
from server.media.plane import MediaPlane
from server.recording.recorder import Recorder
from tests.server.fleet.rig import running_fleet, running_fleet_rig
from tests.server.rig import PATIENCE, TestPeer, eventually, running_bridge


async def _drive_once(peer: TestPeer) -> int:
    """Take the seat, and one event that moves nothing; its number."""
    peer.send("session", SeatRequest())
    await peer.until(lambda each: isinstance(each, Seat) and each.holder != "")
    now = await peer.feedback()
    following = event_after(now.event)
    peer.send("control", Command(event=following, issue=now.issue, values=[0.0] * len(now.axes)))
    await peer.feedback(lambda each: each.event == following)
    return following


async def test_each_robot_has_routes_pages_and_a_session_of_its_own() -> None:
    async with running_fleet_rig("left", "right") as rig:
        for name in ("left", "right"):
            session = (await rig.http.get(f"/robots/{name}/api/session", headers=rig.token("observer"))).json()
            assert session["epoch"] == rig.session(name).console.robot.epoch
            assert (await rig.http.get(f"/robots/{name}/recordings")).headers["content-type"].startswith("text/html")
        assert rig.session("left").console.robot.epoch != rig.session("right").console.robot.epoch
        moved = await rig.http.get("/robots/left")
        assert (moved.status_code, moved.headers["location"]) == (308, "left/")
        for nowhere in ("/robots/middle", "/robots/middle/", "/robots/middle/api/session", "/api/session", "/whep"):
            assert (await rig.http.get(nowhere, headers=rig.token("observer"))).status_code == 404


async def test_the_overview_shows_what_every_robot_does() -> None:
    async with running_fleet_rig("left", "right") as rig, rig.peer("left", "operator") as peer:
        event = await _drive_once(peer)
        tiles = await rig.tiles()
        assert list(tiles) == ["left", "right"]
        left, right = tiles["left"], tiles["right"]
        assert (left["event"], left["driver"], left["participant_count"]) == (event, "operator", 1)
        assert left["participants"] == [{"name": "operator", "role": "operator", "driving": True}]
        assert (right["driver"], right["participants"], right["event"]) == ("", [], 1)
        for tile in tiles.values():
            assert (tile["link"], tile["url"], tile["console"]) == ("up", f"robots/{tile['name']}/", "")
            assert tile["role_may_drive"] is False
            assert tile["feedback_age_ms"] >= 0
            assert tile["has_picture"]


async def test_a_link_for_one_robot_shows_and_opens_no_other() -> None:
    async with running_fleet_rig("left", "right") as rig:
        assert list(await rig.tiles("left")) == ["left"]
        assert await rig.tiles("middle") == {}
        headers = rig.token("operator", "left")
        assert (await rig.http.get("/robots/left/api/session", headers=headers)).status_code == 200
        for method, path in (("GET", "api/session"), ("POST", "api/stop"), ("POST", "whep"), ("GET", "api/recordings")):
            answer = await rig.http.request(method, f"/robots/right/{path}", headers=headers)
            assert (answer.status_code, answer.json()["error"]) == (403, "link_other_robot")
        assert not rig.session("right").console.clock.stop.stopped


async def test_stop_for_all_stops_those_that_the_link_is_good_for() -> None:
    async with running_fleet_rig("left", "right", "third") as rig, rig.peer("left", "observer") as peer:
        answer = await rig.http.post(
            "/api/fleet/stop", headers=rig.token("observer", "left", "right"), json={"reason": "enough"}
        )
        stopped = {each["name"]: each["delivered"] for each in answer.json()["robots"]}
        assert (answer.status_code, stopped) == (200, {"left": True, "right": True})
        for name in ("left", "right"):
            await eventually(lambda name=name: rig.session(name).console.clock.stop.stopped)  # type: ignore[misc]
        assert rig.session("left").console.clock.stop == StopState(stopped=True, by="observer", reason="enough")
        assert (await peer.feedback(lambda each: each.stop.stopped)).stop.reason == "enough"
        assert not rig.session("third").console.clock.stop.stopped
        tiles = await rig.tiles()
        assert [tiles[name]["stopped"] for name in tiles] == [True, True, False]
        nobody = await rig.http.post("/api/fleet/stop", headers=rig.token("observer", "middle"))
        assert (nobody.status_code, nobody.json()["error"]) == (403, "link_other_robot")


async def test_a_robot_that_is_away_keeps_its_stop_and_holds_up_no_other() -> None:
    async with running_bridge() as here, running_bridge() as away:
        port = away.address[1]
        async with running_fleet({"here": here.address[1], "away": port}) as rig:
            await rig.all_reached()
            await away.close()
            console = rig.session("away").console
            await eventually(lambda: not console.robot.up)
            answer = await rig.http.post("/api/fleet/stop", headers=rig.token("operator"))
            found = {each["name"]: each for each in answer.json()["robots"]}
            assert (found["here"]["delivered"], found["away"]["delivered"]) == (True, False)
            assert "kept" in found["away"]["detail"]
            health = (await rig.http.get("/healthz")).json()
            assert (health["status"], health["robots"]["here"]["robot_link"]) == ("degraded", "up")
            ready = await rig.http.get("/readyz")
            assert (ready.status_code, ready.json()) == (200, {"ready": True, "unreachable": ["away"]})
            tile = (await rig.tiles())["away"]
            assert tile["link"] == "down"
            assert tile["detail"]
            async with running_bridge(port):
                await eventually(lambda: console.clock.stop.stopped)


async def test_a_session_that_fails_is_started_again_and_no_other_notices(monkeypatch: pytest.MonkeyPatch) -> None:
    faults: dict[Recorder, asyncio.Event] = {}

    async def until_a_fault(recorder: Recorder) -> None:
        faults[recorder] = asyncio.Event()
        await faults[recorder].wait()
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr(Recorder, "run", until_a_fault)
    async with (
        running_fleet_rig("left", "right") as rig,
        rig.peer("left", "operator") as lost,
        rig.peer("right", "operator") as peer,
    ):
        event = await _drive_once(peer)
        failed, untouched = rig.session("left"), rig.session("right")
        faults[failed.recorder].set()
        await eventually(lambda: rig.fleet.sessions["left"].services is None)
        tile = (await rig.tiles())["left"]
        assert (tile["link"], tile["trouble"]) == ("down", FAILED)
        answer = await rig.http.get("/robots/left/api/session", headers=rig.token("observer"))
        assert (answer.status_code, answer.json()["error"]) == (503, "robot_failed")
        kept = await rig.http.post("/api/fleet/stop", headers=rig.token("operator", "left"))
        assert kept.json()["robots"][0]["delivered"] is False
        await eventually(lambda: rig.fleet.sessions["left"].services is not None)
        await rig.all_reached()
        await eventually(lambda: rig.session("left").console.clock.stop.stopped)
        async with asyncio.timeout(PATIENCE):
            await lost.closed.wait()
        text = (await rig.http.get("/metrics")).text
        assert 'lockstep_fleet_session_failures_total{robot="left"} 1.0' in text
        assert rig.session("right") is untouched
        assert not peer.closed.is_set()
        now = peer.newest_feedback()
        peer.send("control", Command(event=event_after(event), issue=now.issue, values=[0.0] * len(now.axes)))
        await peer.feedback(lambda each: each.event == event_after(event))


async def test_a_fault_in_showing_or_stopping_one_robot_hides_and_spares_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fault(*_: object) -> bool:
        raise RuntimeError("a fault of ours")

    async with running_fleet_rig("left", "right") as rig:
        monkeypatch.setattr(rig.session("left").console, "stop", fault)
        monkeypatch.setattr(rig.session("left").recorder, "state", fault)
        assert (await rig.tiles())["left"]["trouble"] == UNREADABLE
        answer = await rig.http.post("/api/fleet/stop", headers=rig.token("operator"))
        assert [each["delivered"] for each in answer.json()["robots"]] == [False, True]
        await eventually(lambda: rig.session("right").console.clock.stop.stopped)


async def test_a_revoked_link_ends_at_every_robot_at_once() -> None:
    async with running_fleet_rig("left", "right") as rig:
        made = rig.state.invitations.update(lambda known: known.invite(None, "observer", "Ada", 600.0, time.time()))
        token = {"Authorization": f"Bearer {rig.state.access.sign(made.identity, made.created)}"}
        peers = [TestPeer(), TestPeer()]
        try:
            for name, peer in zip(("left", "right"), peers, strict=True):
                await rig.join(name, peer, token)
            revoked = await rig.http.delete(f"/robots/left/api/invitations/{made.id}", headers=rig.token("supervisor"))
            assert revoked.status_code == 200
            async with asyncio.timeout(PATIENCE):
                for peer in peers:
                    await peer.closed.wait()
            for path in ("/api/fleet", "/robots/right/api/session"):
                answer = await rig.http.get(path, headers=token)
                assert (answer.status_code, answer.json()["error"]) == (401, "link_revoked")
        finally:
            for peer in peers:
                await peer.close()


async def test_an_invitation_is_in_the_audit_of_the_robots_that_it_is_good_for() -> None:
    async with running_fleet_rig("left", "right") as rig:
        invited = await rig.http.post("/robots/left/api/invitations", headers=rig.token("operator"), json={})
        assert invited.json()["robots"] == ["left"]
        assert invited.json()["link"].startswith(f"{rig.url}/robots/left/#token=")
        everywhere = await rig.http.post(
            "/robots/left/api/invitations", headers=rig.token("operator"), json={"robots": []}
        )
        assert everywhere.json()["link"].startswith(f"{rig.url}/#token=")
        kinds = {name: [each.kind for each in rig.session(name).audit.tail] for name in ("left", "right")}
        assert [kinds[name].count("invitation") for name in kinds] == [2, 1]


async def test_what_one_robot_keeps_lies_in_a_directory_of_its_own() -> None:
    async with running_fleet_rig("left", "right") as rig:
        started = await rig.http.post("/robots/left/api/recordings", headers=rig.token("operator"), json={})
        assert started.status_code == 201
        ended = await rig.http.post("/robots/left/api/recordings/stop", headers=rig.token("operator"))
        assert ended.status_code == 200
        robots = rig.state.directory.path / "robots"
        assert len(list((robots / "left" / "recordings").glob("*.mcap"))) == 1
        listed = {
            name: (await rig.http.get(f"/robots/{name}/api/recordings", headers=rig.token("observer"))).json()
            for name in ("left", "right")
        }
        assert [len(listed[name]["recordings"]) for name in listed] == [1, 0]
        one = listed["left"]["recordings"][0]["id"]
        ticket = await rig.http.post(f"/robots/left/api/recordings/{one}/ticket", headers=rig.token("operator"))
        path = ticket.json()["path"]
        assert path.startswith(f"/robots/left/api/recordings/{one}/file?ticket=")
        assert (await rig.http.get(path)).status_code == 200
        assert (await rig.http.get(path.replace("/left/", "/right/"))).status_code == 401
        for name in ("left", "right"):
            first = json.loads((robots / name / "audit.jsonl").read_text().splitlines()[0])
            assert first["kind"] == "start"
        assert not (rig.state.directory.path / "audit.jsonl").exists()


async def test_metrics_of_all_robots_stand_in_one_text_each_with_its_name() -> None:
    async with running_fleet_rig("left", "right") as rig, rig.peer("left", "observer"):
        text = (await rig.http.get("/metrics")).text
        families = list(text_string_to_metric_families(text))
        names = [family.name for family in families]
        assert len(names) == len(set(names))
        values = {
            (sample.name, sample.labels.get("robot"), sample.labels.get("role")): sample.value
            for family in families
            for sample in family.samples
        }
        assert values["lockstep_robot_link_up", "left", None] == values["lockstep_robot_link_up", "right", None] == 1
        assert values["lockstep_peers", "left", "observer"] == 1
        assert ("lockstep_peers", "right", "observer") not in values
        assert values["lockstep_fleet_robots", None, None] == 2
        assert sum(name == "process_cpu_seconds_total" for name, _, _ in values) == 1


async def test_all_robots_together_have_only_so_many_places() -> None:
    async with running_fleet_rig("left", "right", max_total_peers=2, reserved_places=1) as rig:
        async with rig.peer("left", "observer"):
            refused = await rig.offer("right", rig.token("observer"))
            assert (refused.status_code, refused.json()["error"]) == (503, "too_many_peers")
            async with rig.peer("right", "operator"):
                refused = await rig.offer("left", rig.token("supervisor"))
                assert refused.json()["error"] == "too_many_peers"
        await eventually(lambda: len(rig.session("left").console.peers) == 0)
        async with rig.peer("right", "observer"):
            pass


async def test_a_thumbnail_is_counted_and_takes_part_in_nothing() -> None:
    async with running_fleet_rig("left", max_thumbnails=1) as rig, rig.peer("left", "operator") as peer:
        async with rig.peer("left", "supervisor", view="thumbnail") as small:
            welcome = await small.until(lambda each: isinstance(each, Welcome))
            assert isinstance(welcome, Welcome)
            assert welcome.role == "observer"
            small.send("session", SeatRequest())
            await small.until(lambda each: getattr(each, "reason", "") == "not_allowed")
            tile = (await rig.tiles())["left"]
            assert (tile["watching"], tile["participant_count"]) == (1, 1)
            people = await small.until(lambda each: isinstance(each, Participants))
            assert isinstance(people, Participants)
            assert [each.name for each in people.participants] == ["operator"]
            refused = await rig.offer("left", rig.token("observer"), "?view=thumbnail")
            assert refused.json()["error"] == "too_many_peers"
            small.send("stop", Stop(by="", reason="seen"))
            assert (await peer.feedback(lambda each: each.stop.stopped)).stop.reason == "seen"
        await eventually(lambda: rig.session("left").console.peers.thumbnails == 0)
        joined = [each.role for each in rig.session("left").audit.tail if each.kind in ("joined", "left")]
        assert joined == ["operator"]


async def test_a_page_of_another_site_cannot_stop_a_fleet() -> None:
    async with running_fleet_rig("left") as rig:
        headers = {**rig.token("operator"), "Origin": "https://elsewhere.example"}
        for path in ("/api/fleet/stop", "/robots/left/api/stop"):
            answer = await rig.http.post(path, headers=headers)
            assert (answer.status_code, answer.json()["error"]) == (403, "origin_refused")


async def test_nobody_without_a_link_sees_the_fleet_and_who_tries_often_is_turned_away() -> None:
    async with running_fleet_rig("left", max_refused_burst=2, max_refused_rate=0.001) as rig:
        answers = [await rig.http.get(path) for path in ("/api/fleet", "/robots/left/api/session", "/api/fleet")]
        assert [each.json()["error"] for each in answers] == ["unauthorized", "unauthorized", "too_many_requests"]


async def test_a_stop_for_all_is_never_turned_away_for_the_rate_of_requests() -> None:
    async with running_fleet_rig("left", max_request_burst=1, max_request_rate=0.001) as rig:
        await rig.http.get("/api/fleet", headers=rig.token("operator"))
        assert (await rig.http.get("/api/fleet", headers=rig.token("operator"))).status_code == 429
        for path in ("/api/fleet/stop", "/robots/left/api/stop"):
            assert (await rig.http.post(path, headers=rig.token("operator"))).status_code == 200


async def test_every_path_that_a_fleet_describes_is_there() -> None:
    async with running_fleet_rig("left") as rig:
        described = (await rig.http.get("/openapi.json")).json()["paths"]
        assert {"/api/fleet", "/api/fleet/stop", "/robots/{robot}/whep", "/healthz", "/readyz"} <= described.keys()
        for path, methods in described.items():
            for method in methods:
                answer = await rig.http.request(method, path.replace("{robot}", "left"))
                assert answer.status_code not in (404, 405, 500), (method, path)


async def _garbage(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """What is no message, for ever."""
    with contextlib.suppress(ConnectionError):
        while not writer.is_closing():
            writer.write(b"\x00\x00\x00\x05\xc1\xff\x00ab" * 100)
            await writer.drain()
            await asyncio.sleep(0)


async def _endless(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """A message that says it is huge."""
    with contextlib.suppress(ConnectionError):
        while not writer.is_closing():
            writer.write(b"\x7f\xff\xff\xff" + bytes(60_000))
            await writer.drain()
            await asyncio.sleep(0)


async def _hung(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Takes the connection and never says a word."""
    await reader.read()


async def _gone(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Closes at once."""


@pytest.mark.parametrize("behaviour", [_garbage, _endless, _hung, _gone])
async def test_a_bridge_that_misbehaves_disturbs_no_other_robot(
    behaviour: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]],
) -> None:
    seen = asyncio.Event()

    async def bad_bridge(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        seen.set()
        try:
            await behaviour(reader, writer)
        finally:
            writer.close()

    bad = await asyncio.start_server(bad_bridge, "127.0.0.1", 0)
    try:
        async with (
            running_bridge() as good,
            running_fleet({"bad": bad.sockets[0].getsockname()[1], "good": good.address[1]}) as rig,
        ):
            async with asyncio.timeout(PATIENCE):
                await seen.wait()
                await rig.session("good").console.robot.reached.wait()
            async with rig.peer("good", "operator") as peer:
                event = await _drive_once(peer)
                for _ in range(5):
                    now, event = peer.newest_feedback(), event_after(event)
                    peer.send("control", Command(event=event, issue=now.issue, values=[0.0] * len(now.axes)))
                    await peer.feedback(lambda each, wanted=event: each.event == wanted)  # type: ignore[misc]
                assert not peer.closed.is_set()
            tiles = await rig.tiles()
            assert (tiles["bad"]["link"], tiles["good"]["link"]) == ("down", "up")
            assert rig.fleet.sessions["bad"].services is not None
    finally:
        bad.close()
        await bad.wait_closed()


async def test_a_robot_whose_directory_cannot_be_made_is_without_a_session_and_the_others_run(tmp_path: Path) -> None:
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "left").write_text("in the way")
    async with running_bridge() as left, running_bridge() as right:
        ports = {"left": left.address[1], "right": right.address[1]}
        async with running_fleet(ports, state_dir=tmp_path) as rig:
            async with asyncio.timeout(PATIENCE):
                await rig.session("right").console.robot.reached.wait()
            tiles = await rig.tiles()
            assert (tiles["left"]["trouble"], tiles["right"]["link"]) == (FAILED, "up")


async def test_a_fault_while_a_session_ends_does_not_keep_the_console_from_ending(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    close = MediaPlane.close

    async def fault(plane: MediaPlane) -> None:
        await close(plane)
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr(MediaPlane, "close", fault)
    async with asyncio.timeout(3 * PATIENCE):
        async with running_fleet_rig("left", "right") as rig:
            pass
    assert all(each.services is None for each in rig.fleet.sessions.values())
