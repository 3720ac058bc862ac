"""Headless clients take VP8 or PCMU alone: that is recorded as it was sent, and no other encoder runs."""

import asyncio
import re
from contextlib import aclosing
from itertools import groupby
from pathlib import Path

import av
import httpx

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.server.recording.export import export_mp4
from lockstep.server.recording.reading.pictures import RecordedPictures
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.verify.verify_file import verify_file
from tests.support.stack import Stack, running_stack

EVENTS = 60
ENCODED = re.compile(r'^lockstep_media_frames_encoded_total\{codec="(\w+)",stream="(\w+)"\} (\S+)$', re.MULTILINE)
CAMERAS, MICROPHONE = ("overview", "front"), "microphone"


async def _ask(stack: Stack, method: str, path: str) -> str:
    token = stack.operator.partition("#token=")[2].partition("&")[0]
    async with httpx.AsyncClient(trust_env=False, timeout=30) as http:
        answer = await http.request(method, stack.console + path, headers={"Authorization": f"Bearer {token}"})
        answer.raise_for_status()
        return answer.text


async def _encoded(stack: Stack, *streams: str) -> dict[tuple[str, str], float]:
    """How many pictures or packets were encoded, by codec and stream."""
    found = ENCODED.findall(await _ask(stack, "GET", "/metrics"))
    return {(codec, stream): float(count) for codec, stream, count in found if stream in streams}


async def test_vp8_that_a_headless_client_takes_is_recorded_and_nothing_else_is_encoded(tmp_path: Path) -> None:
    directory = tmp_path / "recordings"
    settings = {"LOCKSTEP_RECORDING__DIRECTORY": str(directory)}
    async with running_stack(tmp_path, settings=settings) as stack:
        async with Console(stack.operator, codec="VP8", name="Ada") as console:
            await console.take_seat()
            await drive_on(console, [0.3, 0.0, 0.2])
            await _ask(stack, "POST", "/api/recordings")
            for number in range(EVENTS):
                await drive_on(console, [0.3 if number // 15 % 2 == 0 else -0.3, 0.0, 0.2])
            await _ask(stack, "POST", "/api/recordings/stop")
            encoded = await _encoded(stack, *CAMERAS)
        captured = {(each["stream"], each["event"]) for each in await stack.events("media")}
    assert {codec for (codec, _), count in encoded.items() if count} == {"VP8"}
    (path,) = directory.glob("*.mcap")
    verdict = verify_file(path)
    assert [name for name, check in verdict.checks.items() if not check.ok] == []
    for camera in CAMERAS:
        stamps = _stamps_of_what_is_drawn(path, f"/camera/{camera}")
        assert 10 < len(stamps) <= encoded["VP8", camera]
        assert {(camera, stamp) for stamp in stamps} <= captured
        (target,) = (each for each in export_mp4.export(path, tmp_path, "") if each.stem.endswith(camera))
        with av.open(str(target)) as video:
            assert video.streams.video[0].codec_context.name == "h264"
            shown = [read_event_strip(frame.to_ndarray(format="gray")) for frame in video.decode(video=0)]
        assert shown == stamps


def _stamps_of_what_is_drawn(path: Path, topic: str) -> list[int]:
    """Of all pictures; each shows the event that it is stamped with."""
    decoder = RecordedPictures()
    with RecordingReader(path) as reader:
        assert reader.index.keyframes[topic]
        records = list(reader.records(topics={topic}))
    stamps = []
    for number, record in enumerate(records):
        picture = record.picture
        assert picture is not None
        assert (picture.format, picture.keyframe or number > 0) == ("vp8", True)
        (frame,) = decoder.decode(picture)
        assert read_event_strip(frame.to_ndarray(format="gray")) == record.event
        stamps.append(record.event)
    return stamps


async def test_pcmu_that_all_take_is_recorded_and_opus_from_when_somebody_takes_that(tmp_path: Path) -> None:
    directory = tmp_path / "recordings"
    settings = {"LOCKSTEP_RECORDING__DIRECTORY": str(directory)}
    async with (
        running_stack(tmp_path, settings=settings) as stack,
        Console(stack.operator, sound_codec="PCMU", name="Ada") as console,
    ):
        await _heard(console, 5)
        await _ask(stack, "POST", "/api/recordings")
        await _heard(console, 50)
        encoded = await _encoded(stack, MICROPHONE)
        async with Console(stack.observer, video=False, sound_codec="opus", name="Bo") as other:
            await _heard(other, 50)
        await _heard(console, 50)
        await _ask(stack, "POST", "/api/recordings/stop")
    assert {codec for (codec, _), count in encoded.items() if count} == {"PCMU"}
    (path,) = directory.glob("*.mcap")
    assert [name for name, check in verify_file(path).checks.items() if not check.ok] == []
    with RecordingReader(path) as reader:
        records = list(reader.records(topics={f"/microphone/{MICROPHONE}"}))
    sounds = [sound for record in records if (sound := record.sound)]
    assert [codec for codec, _ in groupby(each.format for each in sounds)] == ["g711-ulaw", "opus", "g711-ulaw"]
    assert {len(each.data) for each in sounds if each.format == "g711-ulaw"} == {160}
    for target in export_mp4.export(path, tmp_path, ""):
        with av.open(str(target)) as video:
            assert video.streams.audio[0].codec_context.name == "opus"
            assert sum(frame.samples for frame in video.decode(audio=0)) >= (len(sounds) - 2) * 960


async def _heard(console: Console, packets: int) -> None:
    """So many more came."""
    async with asyncio.timeout(30), aclosing(console.sounds()) as sounds:
        async for _ in sounds:
            packets -= 1
            if packets == 0:
                return
