"""A console with several robots, over HTTP and with peers."""

import json
import time
from contextlib import ExitStack
from itertools import cycle

import pytest
from prometheus_client.parser import text_string_to_metric_families

from lockstep.protocol.console import Participants, SeatRequest, Welcome
from lockstep.protocol.messages import Stop
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import TooManyPeers
from tests.server.fleet.rig import drive_once, running_fleet_rig
from tests.server.rig import eventually


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
        event = await drive_once(peer)
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


async def test_what_one_robot_keeps_lies_in_a_directory_of_its_own() -> None:
    async with running_fleet_rig("left", "right") as rig:
        observer, operator = (
            rig.token("observer"),
            rig.token("operator"),
        )  # a link reads what is recorded while it is good
        started = await rig.http.post("/robots/left/api/recordings", headers=operator, json={})
        assert started.status_code == 201
        ended = await rig.http.post("/robots/left/api/recordings/stop", headers=rig.token("operator"))
        assert ended.status_code == 200
        robots = rig.state.directory.path / "robots"
        assert len(list((robots / "left" / "recordings").glob("*.mcap"))) == 1
        listed = {
            name: (await rig.http.get(f"/robots/{name}/api/recordings", headers=observer)).json()
            for name in ("left", "right")
        }
        assert [len(listed[name]["recordings"]) for name in listed] == [1, 0]
        one = listed["left"]["recordings"][0]["id"]
        ticket = await rig.http.post(f"/robots/left/api/recordings/{one}/ticket", headers=operator)
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


async def test_one_link_cannot_take_all_places_by_way_of_several_robots() -> None:
    async with running_fleet_rig("left", "right", max_total_peers=10, reserved_places=2) as rig:
        link = Identity("observer", "x", "x", time.time() + 3600)
        robots = cycle([rig.session("left").console.peers, rig.session("right").console.peers])
        with ExitStack() as places:
            for _ in range(6):
                places.enter_context(next(robots).places.keep(link))
            with pytest.raises(TooManyPeers, match="this link has all of its 6"):
                places.enter_context(next(robots).places.keep(link))
            places.enter_context(next(robots).places.keep(link._replace(token_id="y")))


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
        await eventually(lambda: not any(each.thumbnail for each in rig.session("left").console.peers))
        joined = [each.role for each in rig.session("left").audit.tail if each.kind in ("joined", "left")]
        assert joined == ["operator"]


async def test_every_path_that_a_fleet_describes_is_there() -> None:
    async with running_fleet_rig("left") as rig:
        described = (await rig.http.get("/openapi.json")).json()["paths"]
        assert {"/api/fleet", "/api/fleet/stop", "/robots/{robot}/whep", "/healthz", "/readyz"} <= described.keys()
        for path, methods in described.items():
            for method in methods:
                answer = await rig.http.request(method, path.replace("{robot}", "left"))
                assert answer.status_code not in (404, 405, 500), (method, path)
