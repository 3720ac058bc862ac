"""The 3D scene: viser behind the console's proxy."""

import asyncio
import json
import subprocess
import sys
from contextlib import AsyncExitStack
from pathlib import Path

import msgspec
import pytest
import viser
import websockets
from hypothesis import given
from hypothesis import strategies as st
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

from lockstep.server.routes import scene_proxy as proxy
from lockstep.server.routes.scene_proxy import is_allowed
from lockstep.server.scene import server, view
from lockstep.server.scene.page import HOOK, ScenePage
from tests.server.rig import PATIENCE, Rig, eventually, links_that_expire, running_rig

VERSION = Subprotocol(f"viser-v{viser.__version__}")


async def _scene_url(rig: Rig) -> tuple[str, str]:
    """The iframe's path, and the WebSocket address in it."""
    answer = await rig.http.post("/api/scene", headers=rig.token("observer"))
    assert answer.status_code == 200, answer.text
    path: str = answer.json()["path"]
    return path, path.split("websocket=")[1].split("&")[0]


async def test_the_client_is_served_and_its_stream_shows_the_robot() -> None:
    async with running_rig(scene=True) as rig:
        path, address = await _scene_url(rig)
        page = await rig.http.get(path)
        assert page.status_code == 200
        assert "text/html" in page.headers["content-type"]
        # The gate has to be there before any script of viser's.
        assert page.text.index(HOOK.decode()) < page.text.index("<script ")
        policy = page.headers["content-security-policy"].split("; ")
        assert policy[0] == "sandbox allow-scripts", "an origin that is nobody's"
        assert f"connect-src {rig.url.replace('http', 'ws')}" in policy
        assert "frame-ancestors 'self'" in policy
        console = (await rig.http.get("/")).headers["content-security-policy"]
        assert "sandbox" not in console
        assert "unsafe-eval" not in console, "nothing of that beside a token"
        packed = await rig.http.get(path, headers={"Accept-Encoding": "gzip"})
        assert (packed.headers["content-encoding"], packed.text) == ("gzip", page.text)
        plain = await rig.http.get(path, headers={"Accept-Encoding": "identity"})
        assert ("content-encoding" in plain.headers, plain.text) == (False, page.text)
        assert address.startswith(rig.url.replace("http", "ws"))
        async with connect(address, subprotocols=[VERSION], proxy=None, max_size=None) as websocket:
            heard = b""
            async with asyncio.timeout(PATIENCE):
                while len(heard) < 1000:
                    heard += bytes(await websocket.recv(decode=False))
            assert rig.count("lockstep_scene_viewers") == 1
        await eventually(lambda: rig.count("lockstep_scene_viewers") == 0)


async def test_viser_is_started_once_for_the_first_who_open_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    starts: list[int] = []
    start = server.start_viser

    def count() -> tuple[viser.ViserServer, ScenePage]:
        starts.append(1)
        return start()

    monkeypatch.setattr(server, "start_viser", count)
    async with running_rig(scene=True) as rig:
        view = rig.dependencies.scene_or_error()
        assert (view.renderer.port, starts) == (0, [])
        await asyncio.gather(*(_scene_url(rig) for _ in range(5)))
        assert view.renderer.port
        assert len(starts) == 1


async def test_a_scene_that_does_not_start_is_said_to_be_unavailable_and_tried_again_for_the_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail() -> None:
        raise OSError("no port")

    monkeypatch.setattr("lockstep.server.scene.view.START_TIMEOUT", 0.2)
    with monkeypatch.context() as broken:
        broken.setattr(server, "start_viser", fail)
        async with running_rig(scene=True) as rig:
            answer = await rig.http.post("/api/scene", headers=rig.token("observer"))
            assert (answer.status_code, answer.json()["error"]) == (503, "scene_unavailable")
            assert rig.count("lockstep_internal_errors_total", where="scene") == 1
            broken.undo()
            monkeypatch.setattr("lockstep.server.scene.view.START_TIMEOUT", PATIENCE)
            await _scene_url(rig)


def test_a_console_that_nobody_asks_for_the_scene_does_not_load_viser() -> None:
    look = (
        "import sys, lockstep.server.cli.main, lockstep.server.cli.console.run_console; "
        "print(sorted({'viser', 'trimesh', 'PIL'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"


async def test_the_stream_needs_a_ticket_and_our_own_page() -> None:
    async with running_rig(scene=True) as rig:
        _, address = await _scene_url(rig)
        token = rig.access.issue("operator", "x")
        for wrong, origin in [
            (address + "x", None),
            (address.rpartition("/")[0] + "/" + token, None),
            (address, "https://evil.example"),
        ]:
            with pytest.raises(websockets.InvalidStatus) as refused:
                await connect(wrong, subprotocols=[VERSION], proxy=None, origin=origin)  # type: ignore[arg-type]
            assert refused.value.response.status_code == 403
        assert rig.count("lockstep_bad_input_total", where="scene", reason="TokenInvalid") == 2
        assert rig.count("lockstep_bad_input_total", where="scene", reason="OriginRefused") == 1


async def test_a_viewer_whose_link_is_revoked_is_shown_nothing_more() -> None:
    async with running_rig(scene=True) as rig:
        invited = await rig.http.post("/api/invitations", headers=rig.token("operator"), json={})
        token = {"Authorization": f"Bearer {invited.json()['link'].partition('#token=')[2]}"}
        path = (await rig.http.post("/api/scene", headers=token)).json()["path"]
        address = path.split("websocket=")[1].split("&")[0]
        async with connect(address, subprotocols=[VERSION], proxy=None, max_size=None) as websocket:
            await rig.http.delete(f"/api/invitations/{invited.json()['id']}", headers=rig.token("supervisor"))
            async with asyncio.timeout(PATIENCE):
                await websocket.wait_closed()
            assert websocket.close_code == 1008
        with pytest.raises(websockets.InvalidStatus):
            await connect(address, subprotocols=[VERSION], proxy=None)


async def test_whoever_is_revoked_while_the_scene_starts_gets_no_page_ticket_or_stream(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with running_rig(scene=True) as rig:
        invited = await rig.http.post("/api/invitations", headers=rig.token("operator"), json={})
        token = {"Authorization": f"Bearer {invited.json()['link'].partition('#token=')[2]}"}
        path = (await rig.http.post("/api/scene", headers=token)).json()["path"]
        waiting, starts = asyncio.Semaphore(0), asyncio.Event()

        async def slow() -> None:
            waiting.release()
            await starts.wait()

        monkeypatch.setattr(rig.dependencies.scene_or_error(), "open", slow)
        connecting = connect(path.split("websocket=")[1].split("&")[0], subprotocols=[VERSION], proxy=None)
        stream = asyncio.create_task(connecting.__aenter__())
        asked = [asyncio.create_task(each) for each in (rig.http.get(path), rig.http.post("/api/scene", headers=token))]
        async with asyncio.timeout(PATIENCE):
            for _ in range(3):
                await waiting.acquire()
            await rig.http.delete(f"/api/invitations/{invited.json()['id']}", headers=rig.token("supervisor"))
            starts.set()
            assert [(await each).json()["error"] for each in asked] == ["link_revoked", "link_revoked"]
            with pytest.raises(websockets.InvalidStatus):
                await stream
        assert rig.count("lockstep_scene_viewers") == 0


async def _scene_with(rig: Rig, token: dict[str, str]) -> str:
    path: str = (await rig.http.post("/api/scene", headers=token)).json()["path"]
    return path.split("websocket=")[1].split("&")[0]


async def test_a_scene_that_is_open_ends_when_its_link_expires_and_no_other_opens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expire = links_that_expire(monkeypatch)
    async with running_rig(scene=True, state_dir=tmp_path) as rig:
        path = (await rig.http.post("/api/scene", headers=rig.token_for_an_hour("observer"))).json()["path"]
        address = path.split("websocket=")[1].split("&")[0]
        async with connect(address, subprotocols=[VERSION], proxy=None, max_size=None) as websocket:
            expire()
            async with asyncio.timeout(PATIENCE):
                await websocket.wait_closed()
            assert websocket.close_code == 1008
        with pytest.raises(websockets.InvalidStatus):
            await connect(address, subprotocols=[VERSION], proxy=None)
        assert (await rig.http.get(path)).json()["error"] == "link_expired"


async def test_the_page_of_the_scene_comes_from_memory_and_asks_nobody() -> None:
    async with running_rig(scene=True) as rig:
        path, _ = await _scene_url(rig)
        rig.dependencies.scene_or_error().renderer.port = 1  # where nobody listens
        for encoding in ("gzip", "identity"):
            answer = await rig.http.get(path, headers={"Accept-Encoding": encoding})
            assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-store")
            assert b"<head><script>" in answer.content


async def test_the_page_of_the_scene_needs_a_ticket() -> None:
    async with running_rig(scene=True) as rig:
        path, _ = await _scene_url(rig)
        token = rig.access.issue("operator", "x")
        for wrong in (path.replace("/scene/", "/scene/x", 1), f"/scene/{token}/"):
            answer = await rig.http.get(wrong)
            assert (answer.status_code, answer.json()["error"]) == (401, "unauthorized")
        for none in ("/scene/", "/scene"):
            assert (await rig.http.get(none)).status_code == 404


@pytest.mark.parametrize(
    "further",
    [
        "playbackPath=data:application/octet-stream;base64,AAAA",
        "websocket=wss://evil.example/",
        "darkMode=x",
        "initialCameraPosition=0",
        "showStats",
    ],
)
async def test_the_page_of_the_scene_takes_no_parameter_but_those_that_the_console_gives_it(further: str) -> None:
    async with running_rig(scene=True) as rig:
        path, _ = await _scene_url(rig)
        answer = await rig.http.get(f"{path}&{further}")
        assert (answer.status_code, answer.json()["error"]) == (422, "bad_parameter")


async def test_the_origin_that_is_nobodys_opens_the_stream_with_a_ticket_and_nothing_else() -> None:
    async with running_rig(scene=True) as rig:
        _, address = await _scene_url(rig)
        opaque = websockets.Origin("null")
        async with connect(address, subprotocols=[VERSION], proxy=None, origin=opaque):
            pass
        with pytest.raises(websockets.InvalidStatus):
            await connect(address + "x", subprotocols=[VERSION], proxy=None, origin=opaque)
        refused = await rig.http.post("/api/stop", headers=rig.token("operator") | {"Origin": "null"})
        assert (refused.status_code, refused.json()["error"]) == (403, "origin_refused")


async def test_only_so_many_may_watch_and_one_link_cannot_take_all_places() -> None:
    async with running_rig(scene=True, max_scene_viewers=8) as rig:
        links = [rig.token("observer") for _ in range(4)]
        async with AsyncExitStack() as open_ones:
            for number, link in enumerate(links):
                for _ in range(2 if number < 3 else 1):  # then only places that are not for observers are left
                    address = await _scene_with(rig, link)
                    await open_ones.enter_async_context(connect(address, subprotocols=[VERSION], proxy=None))
                with pytest.raises(websockets.InvalidStatus):
                    await connect(await _scene_with(rig, link), subprotocols=[VERSION], proxy=None)
            operator = await _scene_with(rig, rig.token("operator"))
            await open_ones.enter_async_context(connect(operator, subprotocols=[VERSION], proxy=None))
        await eventually(lambda: rig.count("lockstep_scene_viewers") == 0)
        async with connect(await _scene_with(rig, links[0]), subprotocols=[VERSION], proxy=None):
            pass


async def test_a_link_that_opens_scenes_again_and_again_is_turned_away_and_others_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(view, "OPEN_RATE", 1e-6)
    async with running_rig(scene=True) as rig:
        address = await _scene_with(rig, rig.token("observer"))
        for _ in range(view.OPENS):
            async with connect(address, subprotocols=[VERSION], proxy=None, max_size=None):
                pass
        with pytest.raises(websockets.InvalidStatus):
            await connect(address, subprotocols=[VERSION], proxy=None)
        assert rig.count("lockstep_bad_input_total", where="scene", reason="SceneUnavailable") == 1
        async with connect(await _scene_with(rig, rig.token("observer")), subprotocols=[VERSION], proxy=None):
            assert rig.count("lockstep_scene_viewers") >= 1


async def test_a_viewer_can_move_the_camera_and_nothing_else() -> None:
    async with running_rig(scene=True) as rig:
        _, address = await _scene_url(rig)
        async with connect(address, subprotocols=[VERSION], proxy=None, max_size=None) as websocket:
            await websocket.send(msgspec.msgpack.encode({"type": "ShareUrlRequest"}))
            await websocket.send("text")
            async with asyncio.timeout(PATIENCE):
                await websocket.wait_closed()
            assert websocket.close_code == 1003
        assert rig.count("lockstep_bad_input_total", where="scene", reason="not_allowed") == 1
        assert rig.count("lockstep_bad_input_total", where="scene", reason="text") == 1


async def test_a_viewer_that_floods_is_read_at_a_pace_and_still_ends_with_its_link(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(proxy, "UP_RATE", 1e-6)
    monkeypatch.setattr(proxy, "UP_BURST", 5.0)
    async with running_rig(scene=True) as rig:
        invited = await rig.http.post("/api/invitations", headers=rig.token("operator"), json={})
        token = {"Authorization": f"Bearer {invited.json()['link'].partition('#token=')[2]}"}
        address = await _scene_with(rig, token)

        def read() -> float:
            return rig.count("lockstep_bad_input_total", where="scene", reason="not_allowed")

        async with connect(address, subprotocols=[VERSION], proxy=None, max_size=None) as websocket:
            for _ in range(100):
                await websocket.send(msgspec.msgpack.encode({"type": "RunJavascriptMessage"}))
            await eventually(lambda: read() == 5)
            for _ in range(20):
                await rig.http.get("/healthz")
            assert read() == 5
            await rig.http.delete(f"/api/invitations/{invited.json()['id']}", headers=rig.token("supervisor"))
            async with asyncio.timeout(PATIENCE):
                await websocket.wait_closed()
            assert websocket.close_code == 1008


async def test_files_that_viser_does_not_have_are_not_found() -> None:
    async with running_rig(scene=True) as rig:
        for path in ("/scene/nothing", "/scene/..%2f..%2f_viser.py"):
            answer = await rig.http.get(path)
            assert (answer.status_code, answer.json()["error"]) == (404, "not_found")


def test_a_camera_message_passes() -> None:
    assert is_allowed(msgspec.msgpack.encode({"type": "ViewerCameraMessage", "fov": 1.0}))


@pytest.mark.parametrize("message", [{"type": "ShareUrlRequest"}, {"type": 5}, {}, [], "ViewerCameraMessage"])
def test_other_messages_do_not_pass(message: object) -> None:
    assert not is_allowed(msgspec.msgpack.encode(message))


@given(st.binary())
def test_no_bytes_pass_or_raise(data: bytes) -> None:
    assert not is_allowed(data)


def test_json_is_not_the_language() -> None:
    assert not is_allowed(json.dumps({"type": "ViewerCameraMessage"}).encode())
