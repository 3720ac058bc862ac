"""STOP for all robots of a console."""

from pathlib import Path

import pytest

from lockstep.protocol.console import Notice, SilenceStops
from lockstep.protocol.messages import Refusal, Stop
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.server.composition.robot_app import attach_session
from lockstep.server.fleet.summaries import UNREADABLE
from tests.server.fleet.rig import running_fleet, running_fleet_rig
from tests.server.rig import TestPeer, eventually, running_bridge, stop_words


async def test_stop_for_all_stops_those_that_the_link_is_good_for() -> None:
    async with running_fleet_rig("left", "right", "third") as rig, rig.peer("left", "observer") as peer:
        answer = await rig.http.post(
            "/api/fleet/stop", headers=rig.token("observer", "left", "right"), json={"reason": "enough"}
        )
        stopped = {each["name"]: each["delivered"] for each in answer.json()["robots"]}
        assert (answer.status_code, stopped) == (200, {"left": True, "right": True})
        for name in ("left", "right"):
            await eventually(lambda name=name: rig.session(name).console.clock.stop.stopped)  # type: ignore[misc]
        assert stop_words(rig.session("left").console.clock.stop) == ("observer", "enough")
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


async def test_a_fault_in_showing_or_stopping_one_robot_hides_and_spares_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fault(*_: object) -> bool:
        raise RuntimeError("a fault of ours")

    async with running_fleet_rig("left", "right") as rig:
        monkeypatch.setattr(rig.session("left").console.stops, "stop", fault)
        monkeypatch.setattr(rig.session("left").recorder, "state", fault)
        assert (await rig.tiles())["left"]["trouble"] == UNREADABLE
        answer = await rig.http.post("/api/fleet/stop", headers=rig.token("operator"))
        assert [each["delivered"] for each in answer.json()["robots"]] == [False, True]
        await eventually(lambda: rig.session("right").console.clock.stop.stopped)


async def test_a_stop_for_all_is_never_turned_away_for_the_rate_of_requests() -> None:
    async with running_fleet_rig("left", max_request_burst=1, max_request_rate=0.001) as rig:
        await rig.http.get("/api/fleet", headers=rig.token("operator"))
        assert (await rig.http.get("/api/fleet", headers=rig.token("operator"))).status_code == 429
        for path in ("/api/fleet/stop", "/robots/left/api/stop"):
            assert (await rig.http.post(path, headers=rig.token("operator"))).status_code == 200


async def test_who_is_silenced_at_one_robot_is_silenced_at_all_with_every_link_that_it_invited() -> None:
    async with running_fleet_rig("left", "right") as rig, rig.peer("left", "supervisor") as supervisor:
        bad, good = rig.token("operator"), rig.token("operator")
        wanted = {"role": "operator", "seconds": 3600, "robots": []}
        invite = "/robots/right/api/invitations"
        made = (await rig.http.post(invite, headers=bad, json=wanted)).json()["link"]
        below = {"Authorization": f"Bearer {made.partition('#token=')[2]}"}
        peer, guest = TestPeer(), TestPeer()
        await rig.join("left", peer, bad)
        await rig.join("right", guest, below)
        try:
            here = next(each for each in rig.session("left").console.peers if each.role == "operator")
            supervisor.send("session", SilenceStops(peer=here.id))
            await peer.until(lambda each: isinstance(each, Notice) and "silenced" in each.text)
            await guest.until(lambda each: isinstance(each, Notice) and "silenced" in each.text)
            for headers in (bad, below):
                for path in ("/robots/left/api/stop", "/robots/right/api/stop"):
                    refused = await rig.http.post(path, headers=headers)
                    assert (refused.status_code, refused.json()["error"]) == (403, "silenced")
                invited = await rig.http.post(invite, headers=headers, json=wanted)
                assert (invited.status_code, invited.json()["error"]) == (403, "silenced")
                answers = (await rig.http.post("/api/fleet/stop", headers=headers)).json()["robots"]
                assert [each["delivered"] for each in answers] == [False, False]
            guest.send("stop", Stop(press="5f" * 16))
            await guest.until(lambda each: isinstance(each, Refusal) and each.reason == "silenced")
            right = rig.session("right")
            attach_session(rig.fleet.sessions["right"].app, None)  # it has failed
            assert (await rig.http.post("/robots/right/api/stop", headers=below)).status_code == 403
            attach_session(rig.fleet.sessions["right"].app, right)
            assert not rig.session("right").console.clock.stop.stopped
            assert (await rig.http.post("/robots/right/api/stop", headers=good)).status_code == 200
        finally:
            await peer.close()
            await guest.close()


async def test_a_stop_for_all_says_which_robot_has_saved_it(tmp_path: Path) -> None:
    robot = create_robot("planar")
    async with (
        Bridge(robot, BridgeSettings(port=0, state_dir=tmp_path)) as saves,
        running_bridge() as forgets,
        running_fleet({"saves": saves.address[1], "forgets": forgets.address[1]}) as rig,
    ):
        await rig.all_reached()
        answer = await rig.http.post("/api/fleet/stop", headers=rig.token("observer"))
        found = {each["name"]: (each["delivered"], each["kept"]) for each in answer.json()["robots"]}
        assert found == {"saves": (True, True), "forgets": (True, False)}
