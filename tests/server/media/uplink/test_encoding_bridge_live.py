"""A bridge that encodes, a console and clients: what is shown, heard and recorded is what the robot encoded."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.encoding.encoder_choice import EncodeSettings
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.server.recording.reading.pictures import RecordedPictures
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.verify.verify_file import verify_file
from tests.server.rig import Rig, running_console
from tests.waiting import PATIENCE

CAMERA, MICROPHONE = "overview", "microphone"


@asynccontextmanager
async def robot_that_encodes(**settings: Any) -> AsyncIterator[tuple[Bridge, Rig]]:
    asked = BridgeSettings(port=0, encode=EncodeSettings(), event_strip=True)
    async with (
        Bridge(create_robot("planar"), asked) as bridge,
        running_console(bridge.address[1], **settings) as rig,
    ):
        async with asyncio.timeout(PATIENCE):
            await rig.dependencies.console.robot.reached.wait()
        yield bridge, rig


def link(rig: Rig, name: str = "Ada") -> str:
    return f"{rig.url}/#token={rig.access.issue('operator', name)}"


async def look_while_driving(console: Console, count: int) -> set[int]:
    """Drive until so many pictures were shown; each shows the event that it is stamped with."""
    found: set[int] = set()
    async with asyncio.timeout(PATIENCE), aclosing(console.pictures(CAMERA)) as pictures:
        shown = 0
        async for picture in pictures:
            assert picture.stamp is not None
            assert picture.gap is not None
            assert picture.gap <= 4
            assert read_event_strip(picture.frame.to_ndarray(format="gray")) == picture.stamp
            found.add(picture.stamp)
            shown += 1
            if shown >= count:
                break
            await drive_on(console, [0.3, 0.0, 0.2])
    return found


def encoded(rig: Rig, codec: str, stream: str = CAMERA) -> float:
    return rig.count("lockstep_media_frames_encoded_total", stream=stream, codec=codec)


async def test_a_client_that_takes_h264_gets_what_the_robot_encoded() -> None:
    async with robot_that_encodes() as (_, rig), Console(link(rig), codec="H264") as console:
        await console.take_seat()
        assert len(await look_while_driving(console, 60)) > 20
        assert encoded(rig, "H264-passed") > 50
        assert encoded(rig, "H264") < 30  # while the console did not know yet that the robot does as it is asked


async def test_clients_of_either_codec_get_true_pictures_side_by_side() -> None:
    async with (
        robot_that_encodes() as (_, rig),
        Console(link(rig), codec="H264") as console,
        Console(link(rig, "Ben"), codec="VP8", name="Ben") as other,
    ):
        await console.take_seat()
        await look_while_driving(console, 20)
        async with asyncio.timeout(PATIENCE), aclosing(other.pictures(CAMERA)) as pictures:
            shown = 0
            async for picture in pictures:
                assert read_event_strip(picture.frame.to_ndarray(format="gray")) == picture.stamp
                shown += 1
                if shown == 10:
                    break
        assert encoded(rig, "VP8") >= 10


async def test_sound_reaches_opus_and_pcmu_clients_and_opus_is_not_encoded_again() -> None:
    async with (
        robot_that_encodes() as (_, rig),
        Console(link(rig)) as console,
        Console(link(rig, "Ben"), sound_codec="PCMU", name="Ben") as other,
    ):
        for client in (console, other):
            loud, stamps = 0.0, 0
            async with asyncio.timeout(PATIENCE), aclosing(client.sounds(MICROPHONE)) as sounds:
                async for sound in sounds:
                    assert sound.stamp is not None
                    loud = max(loud, float(np.abs(sound.frame.to_ndarray().astype(float)).max()))
                    stamps += 1
                    if stamps > 20 and loud > 100:
                        break
        assert encoded(rig, "opus", MICROPHONE) > 20
        assert encoded(rig, "PCMU", MICROPHONE) > 20
        worker = rig.dependencies.media._streams[MICROPHONE].worker
        assert "opus" not in worker.encoder._encoders  # type: ignore[union-attr]


async def test_a_recording_has_what_the_robot_encoded_and_each_picture_shows_its_event(tmp_path: Path) -> None:
    async with (
        robot_that_encodes(recording={"directory": str(tmp_path)}) as (_, rig),
        Console(link(rig), codec="H264") as console,
    ):
        await console.take_seat()
        await look_while_driving(console, 10)
        (await rig.http.post("/api/recordings", headers=rig.token("operator"))).raise_for_status()
        await look_while_driving(console, 60)
        (await rig.http.post("/api/recordings/stop", headers=rig.token("operator"))).raise_for_status()
    assert shown_as_stamped(tmp_path) > 30


def shown_as_stamped(directory: Path) -> int:
    """Return the number of the camera's pictures in the only recording."""
    (path,) = directory.glob("**/*.mcap")
    assert [name for name, check in verify_file(path).checks.items() if not check.ok] == []
    decoder, shown = RecordedPictures(), 0
    with RecordingReader(path) as reader:
        assert reader.index.keyframes[f"/camera/{CAMERA}"]
        for record in reader.records(topics={f"/camera/{CAMERA}"}):
            assert record.picture is not None
            assert record.picture.format == "h264"
            (frame,) = decoder.decode(record.picture)
            assert read_event_strip(frame.to_ndarray(format="gray")) == record.event
            shown += 1
    return shown
