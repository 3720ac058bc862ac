"""What a link opens in a fleet."""

import asyncio
import time

from tests.server.fleet.rig import running_fleet_rig
from tests.server.rig import PATIENCE, TestPeer


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


async def test_nobody_without_a_link_sees_the_fleet_and_who_tries_often_is_turned_away() -> None:
    async with running_fleet_rig("left", max_refused_burst=2, max_refused_rate=0.001) as rig:
        answers = [await rig.http.get(path) for path in ("/api/fleet", "/robots/left/api/session", "/api/fleet")]
        assert [each.json()["error"] for each in answers] == ["unauthorized", "unauthorized", "too_many_requests"]


async def test_a_page_of_another_site_cannot_stop_a_fleet() -> None:
    async with running_fleet_rig("left") as rig:
        headers = {**rig.token("operator"), "Origin": "https://elsewhere.example"}
        for path in ("/api/fleet/stop", "/robots/left/api/stop"):
            answer = await rig.http.post(path, headers=headers)
            assert (answer.status_code, answer.json()["error"]) == (403, "origin_refused")
