"""The Foxglove server on a real console with the planar robot, looked at by a viewer that knows only the protocol."""

import asyncio
import json
from pathlib import Path
from typing import Any

import av
import foxglove
import msgspec
import pytest
from foxglove.websocket import WebSocketServer
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from lockstep.protocol.console import Seat, SeatOffer, SeatRequest, SeatTake
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.episodes import EpisodeRequest
from lockstep.server.recording.format.topics import (
    AXIS_COMMANDS,
    AXIS_STATES,
    CALIBRATION,
    CAMERA,
    FIXED_TRANSFORMS,
    JOINTS,
    MAP,
    MICROPHONE,
    ODOMETRY,
    POSE,
    SCAN,
    SHAPES,
    TRANSFORMS,
    WRENCH,
    stream_of,
    topics_of,
)
from tests.server.foxglove.viewer import viewing
from tests.server.rig import PATIENCE, Rig, eventually, running_rig


async def listening(rig: Rig) -> int:
    service = rig.dependencies.foxglove
    assert service is not None
    async with asyncio.timeout(PATIENCE):
        await service.listening.wait()
    return service.port


def is_recorded(rig: Rig) -> bool:
    return rig.dependencies.media.is_recorded


async def test_a_viewer_gets_the_state_that_holds_and_the_feedback_of_a_robot_that_idles() -> None:
    async with running_rig(foxglove={"port": 0}) as rig, viewing(await listening(rig)) as viewer:
        await viewer.subscribe("/lockstep/robot", "/lockstep/seat", "/lockstep/feedback", "/tf", "/tf_static")
        robot = await viewer.next_of("/lockstep/robot")
        await viewer.next_of("/lockstep/seat")
        feedback = await viewer.next_of("/lockstep/feedback")
        moving = await viewer.next_of("/tf")
        fixed = await viewer.next_of("/tf_static")
        assert viewer.info["capabilities"] == []
    description = robot.message["description"]
    bodies = {each["name"] for each in description["bodies"]}
    cameras = {each["name"] for each in description["cameras"] if each["calibration"] is not None}
    frames = {each.child_frame_id for each in (*moving.message.transforms, *fixed.message.transforms)}
    assert frames == bodies | cameras
    assert robot.message["epoch"] == feedback.message["epoch"]
    assert feedback.message["event"] >= 1


async def test_pictures_come_from_a_keyframe_on_and_a_stamp_names_the_event_of_each() -> None:
    async with running_rig(foxglove={"port": 0}) as rig, viewing(await listening(rig)) as viewer:
        await viewer.until(lambda: "/lockstep/stamp" in viewer.channels)
        camera = next(topic for topic in viewer.channels if topic.startswith("/camera/"))
        assert not is_recorded(rig)
        await viewer.subscribe(camera, "/lockstep/stamp")
        await viewer.until(lambda: len(viewer.of(camera)) >= 5 and len(viewer.of("/lockstep/stamp")) >= 5)
        assert is_recorded(rig)
        pictures = [CompressedVideo.FromString(each.SerializeToString()) for each in viewer.of(camera)]
        stamps = {
            (each["timestamp"]["sec"], each["timestamp"]["nsec"]): each["event"]
            for each in viewer.of("/lockstep/stamp")
            if each["stream"] == camera.removeprefix("/camera/")
        }
        await viewer.unsubscribe_all()
        async with asyncio.timeout(PATIENCE):
            while is_recorded(rig):  # noqa: ASYNC110
                await asyncio.sleep(0.01)
    decoder = av.CodecContext.create("h264", "r")
    for picture in pictures[:4]:
        assert picture.format == "h264"
        (frame,) = decoder.decode(av.Packet(picture.data))
        assert frame.width > 0
        assert stamps[picture.timestamp.seconds, picture.timestamp.nanos] >= 1


async def test_what_happens_is_told_and_no_message_of_a_viewer_does_anything() -> None:
    async with (
        running_rig(foxglove={"port": 0}) as rig,
        viewing(await listening(rig)) as viewer,
        rig.peer("operator") as operator,
    ):
        await viewer.subscribe("/lockstep/stop", "/lockstep/participants", "/log", "/lockstep/feedback")
        await viewer.next_of("/lockstep/participants", lambda each: bool(each["participants"]))
        channel = {"id": 1, "topic": "/lockstep/command", "encoding": "json", "schemaName": ""}
        await viewer.socket.send(json.dumps({"op": "advertise", "channels": [channel]}))
        await viewer.socket.send(b"\x01\x01\0\0\0{}")
        await viewer.socket.send("this is no JSON")
        await rig.http.post("/api/stop", headers=rig.token("operator"))
        stop = await viewer.next_of("/lockstep/stop", lambda each: each["kind"] == "stop")
        await viewer.next_of("/lockstep/feedback", lambda each: each["stop"]["stopped"])
        await viewer.next_of("/log")
        assert stop.message["where"] == "http"
        assert not operator.closed.is_set()


async def test_all_that_a_recording_would_have_is_offered_and_what_is_measured_arrives() -> None:
    """The robot has a base, bodies, joints, a wrench, ranges, a map, and a camera whose place is known."""
    async with (
        running_rig(foxglove={"port": 0}, seat_timeout=60.0) as rig,
        viewing(await listening(rig)) as viewer,
        rig.peer("operator") as operator,
    ):
        await viewer.subscribe("/lockstep/robot", "/lockstep/stamp")
        robot = await viewer.next_of("/lockstep/robot")
        description = msgspec.convert(robot.message["description"], RobotDescription)
        media = [each for each in viewer.channels if each.startswith((CAMERA, MICROPHONE))]
        codecs = {stream_of(each): "H264" if each.startswith(CAMERA) else "opus" for each in media}
        recorded = {each.name for each in topics_of(description, codecs)}
        assert viewer.channels.keys() == recorded | {"/lockstep/stamp"}
        calibrations = {CALIBRATION + each.name for each in description.cameras if each.calibration is not None}
        measured = {JOINTS, SCAN, POSE, ODOMETRY, WRENCH, AXIS_STATES, AXIS_COMMANDS, TRANSFORMS}
        told = {FIXED_TRANSFORMS, SHAPES, MAP, *calibrations, *media}
        await viewer.subscribe(*measured, *told, "/lockstep/command", "/lockstep/status", "/lockstep/navigation")
        operator.send("session", SeatRequest())
        await operator.until(lambda each: isinstance(each, Seat) and bool(each.holder))
        await operator.feedback()
        await operator.drive([0.2, 0.0, 0.1])
        for topic in (*measured, *told, "/lockstep/command", "/lockstep/status", "/lockstep/navigation"):
            await viewer.next_of(topic)
        commands = await viewer.next_of(AXIS_COMMANDS, lambda each: any(axis.value for axis in each.axes))
        wrench, odometry = viewer.of(WRENCH)[0], viewer.of(ODOMETRY)[0]
        (calibration,) = (viewer.of(each)[0] for each in calibrations)
        shapes = viewer.of(SHAPES)[0]
    assert calibrations
    assert [axis.value for axis in commands.message.axes] == pytest.approx([0.2, 0.0, 0.1])
    assert wrench.frame_id
    assert odometry.frame_id != odometry.body_frame_id
    assert calibration.width > 0
    assert len(calibration.K) == 9
    assert {each.frame_id for each in shapes.entities} <= {each.name for each in description.bodies} | {""}


async def test_who_subscribes_without_end_calls_nothing_in_the_console(monkeypatch: pytest.MonkeyPatch) -> None:
    """A call from the SDK's threads for each subscription would keep the interpreter from the operator's commands."""
    started: list[dict[str, Any]] = []

    def start_server(**wanted: Any) -> WebSocketServer:
        started.append(wanted)
        return original(**wanted)

    original = foxglove.start_server
    monkeypatch.setattr(foxglove, "start_server", start_server)
    async with running_rig(foxglove={"port": 0}) as rig, viewing(await listening(rig)) as viewer:
        for _ in range(50):
            await viewer.subscribe("/lockstep/seat")
            await viewer.unsubscribe_all()
        await viewer.subscribe("/lockstep/seat")
        await viewer.next_of("/lockstep/seat")
    (wanted,) = started
    assert wanted.keys().isdisjoint({"server_listener", "services", "asset_handler", "channel_filter"})
    assert wanted["capabilities"] == []


async def test_who_subscribes_to_what_another_watches_gets_the_state_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lockstep.server.foxglove.service.REPEAT_SECONDS", 0.5)
    async with running_rig(foxglove={"port": 0}) as rig:
        port = await listening(rig)
        async with viewing(port) as one, viewing(port) as other:
            await one.subscribe("/lockstep/seat")
            await one.next_of("/lockstep/seat")
            await other.subscribe("/lockstep/seat")
            await other.next_of("/lockstep/seat")


async def test_a_viewer_is_told_who_drives_and_what_is_an_intervention_and_of_episodes(tmp_path: Path) -> None:
    wanted = {
        "foxglove": {"port": 0},
        "recording": {"directory": tmp_path},
        "episodes": {"countdown_seconds": 0.0},
        "seat_timeout": 60.0,  # test peers have no heartbeat
    }
    async with (
        running_rig(**wanted) as rig,
        viewing(await listening(rig)) as viewer,
        rig.peer("operator") as person,
        rig.peer("policy") as policy,
    ):
        await viewer.subscribe("/lockstep/feedback", "/lockstep/episode")
        await viewer.next_of("/lockstep/feedback")
        rig.dependencies.recorder.start("", "")
        person.send("session", SeatRequest())
        await person.until(lambda each: isinstance(each, Seat) and each.kind == "human")
        await eventually(lambda: rig.dependencies.recorder.state().id)
        person.send("session", EpisodeRequest(id="1", do="start", task="push"))
        await viewer.next_of("/lockstep/episode", lambda each: each["kind"] == "start")
        await person.feedback()
        await person.drive([0.0, 0.1, 0.0])
        person.send("session", SeatOffer())
        await policy.until(lambda each: isinstance(each, Seat) and each.offered)
        policy.send("session", SeatRequest(only_if_free=True))
        await policy.until(lambda each: isinstance(each, Seat) and each.kind == "policy")
        await policy.drive([0.2, 0.0, 0.0])
        person.send("session", SeatTake())
        await policy.until(lambda each: isinstance(each, Seat) and each.why == "taken")
        await person.drive([0.0, 0.1, 0.0])
        await viewer.next_of("/lockstep/feedback", lambda each: each["intervention"])
        person.send("session", EpisodeRequest(id="2", do="discard"))
        await viewer.next_of("/lockstep/episode", lambda each: each["kind"] == "discarded")
        driven = [each for each in viewer.of("/lockstep/feedback") if each["driver_kind"] != "none"]
    spells = [(each["driver_kind"], each["intervention"]) for each in driven]
    assert list(dict.fromkeys(spells)) == [("human", False), ("policy", False), ("human", True)]


async def test_a_port_that_is_taken_takes_nothing_but_the_viewers_from_the_console() -> None:
    taken = await asyncio.start_server(lambda *_: None, "127.0.0.1", 0)
    port = taken.sockets[0].getsockname()[1]
    async with taken, running_rig(foxglove={"port": port}) as rig, rig.peer("operator") as operator:
        await operator.feedback()
        assert rig.dependencies.foxglove is not None
        assert not rig.dependencies.foxglove.listening.is_set()


async def test_a_viewer_that_does_not_read_delays_no_other() -> None:
    async with running_rig(foxglove={"port": 0}) as rig:
        port = await listening(rig)
        async with viewing(port) as slow, viewing(port) as viewer:
            await slow.subscribe("/lockstep/feedback")
            slow.socket.transport.pause_reading()
            await viewer.subscribe("/lockstep/feedback")
            await viewer.until(lambda: len(viewer.of("/lockstep/feedback")) > 3)
            slow.socket.transport.resume_reading()


async def test_without_a_port_there_is_no_server() -> None:
    async with running_rig() as rig:
        assert rig.dependencies.foxglove is None
