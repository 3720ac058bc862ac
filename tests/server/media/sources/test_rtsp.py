"""A network camera that asks for a password, goes away and comes back."""

import asyncio

from lockstep.server.media.codecs.h264 import inspect
from tests.server.media.sources.rtsp_server import running_camera
from tests.server.media.sources.test_attached_source import watching


async def test_a_network_camera_is_passed_on_with_its_parameter_sets_and_comes_back_after_an_outage() -> None:
    async with running_camera() as camera:
        port = camera.port
        async with watching(camera.url) as watched:
            await watched.until(lambda: sum(medium.keyframe for medium in watched.media) >= 2)
            assert camera.requests[:2] == ["OPTIONS", "DESCRIBE"]
            assert watched.media[0].keyframe
            for medium in watched.media:
                access = inspect(medium.payload)
                assert medium.codec == "h264"
                assert (access.profile is not None) == medium.keyframe
                assert medium.time <= asyncio.get_running_loop().time() - 0.3  # the latency of RTSP unless set
            camera.hang_up()
            await watched.until(lambda: watched.source.state == "reconnecting")
            seen = len(watched.media)
            await watched.until(lambda: len(watched.media) > seen)
            assert watched.source.state == "live"
            assert set(watched.failures) <= {"ended", "silent", "failed"}
    assert port


async def test_a_wrong_password_is_said_without_repeating_it() -> None:
    async with running_camera() as camera, watching(camera.url.replace("geheim", "falsch")) as watched:
        await watched.until(lambda: bool(watched.failures))
        assert watched.failures[0] == "unauthorized"
        assert "falsch" not in watched.source.detail
