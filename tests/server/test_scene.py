"""The 3D scene: viser behind the console's proxy."""

import asyncio
import json

import msgspec
import pytest
import viser
import websockets
from hypothesis import given
from hypothesis import strategies as st
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

from server.scene_proxy import HOOK, is_allowed
from tests.server.rig import PATIENCE, Rig, eventually, running_rig

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
        # The page around it has to get at it before any script of viser's.
        assert page.text.index(HOOK.decode()) < page.text.index("<script ")
        assert "frame-ancestors 'self'" in page.headers["content-security-policy"]
        assert address.startswith(rig.url.replace("http", "ws"))
        async with connect(address, subprotocols=[VERSION], proxy=None, max_size=None) as websocket:
            heard = b""
            async with asyncio.timeout(PATIENCE):
                while len(heard) < 1000:
                    heard += bytes(await websocket.recv(decode=False))
            assert rig.count("lockstep_scene_viewers") == 1
        await eventually(lambda: rig.count("lockstep_scene_viewers") == 0)


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


async def test_only_so_many_may_watch() -> None:
    async with running_rig(scene=True, max_scene_viewers=1) as rig:
        _, address = await _scene_url(rig)
        async with connect(address, subprotocols=[VERSION], proxy=None):
            with pytest.raises(websockets.InvalidStatus):
                await connect(address, subprotocols=[VERSION], proxy=None)


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
