"""The HTTP API of a console that runs, with a real bridge."""

import re
from pathlib import Path

import pytest

from lockstep.protocol.console import StopStateNotice
from lockstep.protocol.messages import StopState
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.settings import BridgeSettings
from tests.server.rig import Rig, eventually, reset_by_http, running_console, running_rig, stop_words


async def _stop_state(rig: Rig, *, stopped: bool) -> StopState:
    """What the bridge said last, once it says so."""
    async with rig.peer("observer", "stop") as peer:
        notice = await peer.until(lambda each: isinstance(each, StopStateNotice) and each.stop.stopped == stopped)
        assert isinstance(notice, StopStateNotice)
        return notice.stop


async def test_without_a_valid_token_nothing_is_said() -> None:
    async with running_rig() as rig:
        for method, path in [
            ("GET", "/api/session"),
            ("POST", "/api/stop"),
            ("POST", "/api/reset"),
            ("POST", "/api/scene"),
            ("POST", "/whep"),
            ("PATCH", "/whep/x"),
            ("DELETE", "/whep/x"),
        ]:
            for headers in ({}, {"Authorization": "Bearer x"}, {"Authorization": "Basic x"}):
                answer = await rig.http.request(method, path, headers=headers)
                assert (answer.status_code, answer.json()["error"]) == (401, "unauthorized"), (method, path)
                assert answer.headers["www-authenticate"].startswith("Bearer")
        assert rig.count("lockstep_bad_input_total", where="http", reason="unauthorized") == 21


async def test_the_session_tells_what_is_going_on() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        await peer.feedback()
        session = await rig.session()
        assert session["epoch"]
        assert session["event"] == 1
        assert session["stopped"] is False
        assert session["seat"]["holder"] == ""
        assert [each["role"] for each in session["participants"]] == ["operator"]
        assert session["link"] == {"up": True, "detail": ""}
        assert session["you"] == {"role": "observer", "name": "observer"}
        assert session["description"]["axes"]


async def test_an_observer_can_stop_and_only_the_holder_of_the_seat_or_a_supervisor_can_reset() -> None:
    async with running_rig() as rig:
        answer = await rig.http.post("/api/stop", headers=rig.token("observer"), json={"reason": "dog in the room"})
        assert (answer.status_code, answer.json()["delivered"]) == (200, True)
        assert stop_words(await _stop_state(rig, stopped=True)) == ("observer", "dog in the room")
        assert (await rig.session())["stopped"] is True
        number = rig.dependencies.console.clock.stop.number
        assert answer.json()["number"] == number
        for token, error in ((rig.token("observer"), "not_allowed"), (rig.token("operator"), "no_seat")):
            refused = await rig.http.post("/api/reset", headers=token, json={"number": number})
            assert (refused.status_code, refused.json()["error"]) == (403, error)
        headers = rig.token("supervisor")
        stops = 1
        while (early := await rig.http.post("/api/reset", headers=headers, json={"number": number})).is_success:
            again = await rig.http.post("/api/stop", headers=headers)  # a busy machine took a second to ask
            number, stops = again.json()["number"], stops + 1
        assert (early.status_code, early.json()["error"]) == (409, "too_soon")
        stale = await rig.http.post("/api/reset", headers=headers, json={"number": number - 1})
        assert (stale.status_code, stale.json()["error"]) == (409, "stale_reset")
        nameless = await rig.http.post("/api/reset", headers=headers)
        assert (nameless.status_code, nameless.json()["error"]) == (400, "bad_json")
        assert (await rig.session())["stopped"] is True
        await reset_by_http(
            rig.http, "/api/reset", rig.token("supervisor"), lambda: rig.dependencies.console.clock.stop
        )
        await _stop_state(rig, stopped=False)
        assert rig.count("lockstep_stops_total", where="http") == stops


@pytest.mark.parametrize("keeps", [True, False])
async def test_whoever_stops_over_http_is_told_whether_the_stop_is_on_the_robots_disk(
    tmp_path: Path, keeps: bool
) -> None:
    settings = BridgeSettings(port=0, state_dir=tmp_path if keeps else None)
    async with Bridge(create_robot("planar"), settings) as bridge, running_console(bridge.address[1]) as rig:
        await eventually(lambda: rig.dependencies.console.robot.up)
        answer = await rig.http.post("/api/stop", headers=rig.token("observer"))
        assert (answer.json()["delivered"], answer.json()["kept"]) == (True, keeps)


async def test_a_press_whose_stop_was_reset_stops_nothing_and_says_so() -> None:
    press, wanted = "5f" * 16, {"reason": "dog in the room"}
    async with running_rig() as rig:
        headers = rig.token("observer")
        for _ in range(2):  # a repeat has the outcome of the first
            answer = await rig.http.post("/api/stop", headers=headers, json={**wanted, "press": press})
            assert answer.status_code == 200
        await _stop_state(rig, stopped=True)
        await reset_by_http(
            rig.http, "/api/reset", rig.token("supervisor"), lambda: rig.dependencies.console.clock.stop
        )
        await _stop_state(rig, stopped=False)
        used = await rig.http.post("/api/stop", headers=headers, json={**wanted, "press": press})
        assert (used.status_code, used.json()["error"]) == (409, "press_used")
        again = await rig.http.post("/api/stop", headers=headers, json=wanted)
        assert again.status_code == 200
        await _stop_state(rig, stopped=True)


async def test_what_a_good_link_may_not_do_is_named_however_often_its_address_failed_to_say_who_it_is() -> None:
    async with running_rig(max_refused_burst=1) as rig:
        for _ in range(3):
            await rig.http.get("/api/session")
        refused = await rig.http.post("/api/reset", headers=rig.token("observer"), json={"number": 1})
        assert (refused.status_code, refused.json()["error"]) == (403, "not_allowed")


async def test_a_stop_needs_no_body() -> None:
    async with running_rig() as rig:
        assert (await rig.http.post("/api/stop", headers=rig.token("operator"))).status_code == 200


@pytest.mark.parametrize(
    ("body", "status", "name"),
    [
        (b"{", 400, "bad_json"),
        (b'{"number": "x"}', 400, "bad_json"),
        (b"\xff\xfe", 400, "bad_json"),
        (b"[" * 3000, 400, "bad_json"),
        (b"x" * 5000, 413, "too_large"),
    ],
)
async def test_a_body_that_is_not_understood_is_refused_by_name(body: bytes, status: int, name: str) -> None:
    async with running_rig() as rig:
        answer = await rig.http.post("/api/reset", headers=rig.token("operator"), content=body)
        assert (answer.status_code, answer.json()["error"]) == (status, name)
        assert rig.count("lockstep_bad_input_total", where="http", reason=name) == 1


@pytest.mark.parametrize(
    ("body", "reason", "refused"),
    [
        (b"{", "", "bad_json"),
        (b"a person is in the cell", "", "bad_json"),
        (b"\xff\xfe", "", "bad_json"),
        (b"[" * 3000, "", "bad_json"),
        (b"x" * 5000, "", "too_large"),
        (b'{"reason": 5, "press": null}', "5", ""),
        (b'{"reason": "' + b"x" * 501 + b'"}', "x" * 500, ""),
    ],
)
async def test_a_stop_is_a_stop_whatever_its_body_is(body: bytes, reason: str, refused: str) -> None:
    async with running_rig() as rig:
        answer = await rig.http.post("/api/stop", headers=rig.token("observer"), content=body)
        assert (answer.status_code, answer.json()["delivered"]) == (200, True), answer.text
        assert stop_words(await _stop_state(rig, stopped=True)) == ("observer", reason)
        assert rig.count("lockstep_bad_input_total", where="http", reason=refused) == (1 if refused else 0)


@pytest.mark.parametrize("given", ["estop", "5F" * 16, "x" * 64, "\u2028\N{SNOWMAN}", "../../etc/passwd", "0" * 31])
async def test_a_press_with_an_id_of_any_kind_is_one_stop_and_is_told_by_that_id(given: str) -> None:
    async with running_rig() as rig:
        headers, other = rig.token("observer"), rig.token("observer")
        first, again = [
            (await rig.http.post("/api/stop", headers=headers, json={"press": given})).json() for _ in range(2)
        ]
        assert first["press"] == again["press"] == given
        assert first["number"] == again["number"]
        assert first["kept"] is False, "this bridge has no disk"
        shown = (await _stop_state(rig, stopped=True)).press
        assert re.fullmatch("[0-9a-f]{32}", shown), "what others are told, and what is written down"
        theirs = (await rig.http.post("/api/stop", headers=other, json={"press": given})).json()
        assert theirs["number"] == first["number"] + 1, "another link's press is another stop"
        assert theirs["press"] == given


async def test_an_id_that_is_longer_than_any_is_told_as_it_is_called_here() -> None:
    async with running_rig() as rig:
        headers = rig.token("observer")
        answers = [await rig.http.post("/api/stop", headers=headers, json={"press": "x" * 900}) for _ in range(2)]
        first, again = [answer.json() for answer in answers]
        assert first == again
        assert re.fullmatch("[0-9a-f]{32}", first["press"])


async def test_unknown_paths_and_methods_are_refused_by_name() -> None:
    async with running_rig() as rig:
        for method, path, status, name in [
            ("GET", "/nothing", 404, "not_found"),
            ("GET", "/api/nothing", 404, "not_found"),
            ("GET", "/%2e%2e/settings.py", 404, "not_found"),
            ("GET", "/..%2fsettings.py", 404, "not_found"),
            ("PUT", "/api/session", 405, "method_not_allowed"),
        ]:
            answer = await rig.http.request(method, path)
            assert (answer.status_code, answer.json()["error"]) == (status, name), path


async def test_pages_of_other_sites_are_refused() -> None:
    async with running_rig(allowed_origins="https://friend.example") as rig:
        headers = rig.token("operator")
        for origin, status in [
            (rig.url, 200),
            ("https://friend.example", 200),
            ("https://evil.example", 403),
            ("null", 403),
            ("http://[", 403),
            ("http://a]b", 403),
            ("", 403),
        ]:
            answer = await rig.http.post("/api/stop", headers={**headers, "Origin": origin})
            assert answer.status_code == status, origin
        assert (await rig.http.get("/api/session", headers={**headers, "Origin": "https://evil.example"})).is_success


async def test_every_answer_carries_the_security_headers() -> None:
    async with running_rig() as rig:
        for path in ("/", "/healthz", "/nothing", "/api/session"):
            headers = (await rig.http.get(path)).headers
            assert "frame-ancestors 'none'" in headers["content-security-policy"]
            assert headers["referrer-policy"] == "no-referrer"
            assert headers["x-content-type-options"] == "nosniff"
            assert "server" not in headers


async def test_pages_may_use_hid_devices_only_where_force_feedback_is_switched_on() -> None:
    for on, allowed in ((False, "hid=()"), (True, "hid=(self)")):
        async with running_rig(force_feedback=on) as rig:
            permissions = (await rig.http.get("/")).headers["permissions-policy"].split(", ")
            assert allowed in permissions
            assert "usb=()" in permissions


async def test_health_and_metrics_need_no_token() -> None:
    async with running_rig() as rig:
        assert (await rig.http.get("/healthz")).json() == {"status": "ok", "robot_link": "up", "links": "ok"}
        assert (await rig.http.get("/readyz")).json() == {"ready": True}
        text = (await rig.http.get("/metrics")).text
        assert "lockstep_robot_link_up 1.0" in text
        assert "lockstep_event 1.0" in text


async def test_without_a_robot_the_console_runs_and_says_so() -> None:
    async with running_console(1) as rig:
        health = (await rig.http.get("/healthz")).json()
        assert health == {"status": "degraded", "robot_link": "down", "links": "ok"}, "no address and no reason"
        assert (await rig.http.get("/readyz")).status_code == 200, "it serves all the same"
        session = await rig.session()
        assert (session["epoch"], session["description"]) == ("", None)
        for path in ("/api/stop", "/api/reset"):
            answer = await rig.http.post(path, headers=rig.token("supervisor"), json={"number": 1})
            assert (answer.status_code, answer.json()["error"]) == (503, "link_down")
        answer = await rig.http.post("/api/scene", headers=rig.token("operator"))
        assert (answer.status_code, answer.json()["error"]) == (503, "scene_unavailable")
