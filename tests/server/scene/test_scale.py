"""Small robots are magnified for the 3D scene, and what cannot be drawn ends nothing."""

import asyncio
import math
import threading

import msgspec
import pytest

from lockstep.protocol.description import Axis, Body, BodyJoint, CameraCalibration, Geom, RobotDescription
from lockstep.protocol.description import Pose as Pose3
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.robots.micromanipulator.description import DESCRIPTION as MICRO
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION as PLANAR
from lockstep.server.auth.tokens import SceneTicket
from lockstep.server.scene.commanded_path import CommandedPath
from lockstep.server.scene.kinematics import Pose
from lockstep.server.scene.scale import SceneScale
from lockstep.server.scene.view import SceneView, pause
from lockstep.server.session_events import EpochBegan, FeedbackReceived, SessionEvents
from lockstep.server.telemetry.metrics import Metrics
from tests.server.rig import eventually

FEEDBACK = Feedback(event=1, issue=1, time=0.0, axes=[], joints=[1e-5, -2e-5, 3e-5, 0.0, 0.0, 0.0], wrench=[1e-5, 0, 0])


def test_a_robot_of_metres_stays_as_it_is() -> None:
    scale = SceneScale(PLANAR)
    assert scale.description(PLANAR) is PLANAR
    assert scale.feedback(FEEDBACK) is FEEDBACK


def test_a_robot_of_micrometres_gets_metres_large_and_its_joints_with_it() -> None:
    scale = SceneScale(MICRO)
    large = scale.description(MICRO)
    assert 0.5 < max(max(geom.size) for body in large.bodies for geom in body.geoms) < 5.0
    assert large.joints[0].maximum == pytest.approx((MICRO.joints[0].maximum or 0) * scale.factor)
    moved = scale.feedback(FEEDBACK)
    assert moved.joints == pytest.approx([value * scale.factor for value in FEEDBACK.joints])
    assert moved.wrench == FEEDBACK.wrench
    assert [body.geoms[0].rgba for body in large.bodies] == [body.geoms[0].rgba for body in MICRO.bodies]


def test_a_mesh_of_micrometres_is_magnified_too() -> None:
    corners = tuple(1e-6 * each for each in (0, 0, 0, 1, 0, 0, 0, 1, 0))
    tiny = RobotDescription(
        name="r",
        label="R",
        axes=(),
        bodies=(Body(name="m", parent="", geoms=(Geom(shape="mesh", vertices=corners, triangles=(0, 1, 2)),)),),
    )
    scale = SceneScale(tiny)
    assert 0.1 < max(scale.description(tiny).bodies[0].geoms[0].vertices) < 10.0


def test_angles_are_not_magnified() -> None:
    joints = tuple(msgspec.structs.replace(joint, unit="rad") for joint in MICRO.joints)
    scale = SceneScale(msgspec.structs.replace(MICRO, joints=joints))
    assert scale.factor > 1
    assert scale.feedback(FEEDBACK).joints == FEEDBACK.joints


def test_goals_and_the_places_of_cameras_are_magnified_with_the_robot() -> None:
    goal = {"minimum": -9, "maximum": 9, "slew": 1, "brake": 1, "kind": "goal", "label": ""}
    units = (("x", "m"), ("r", "rad"))
    axes = tuple(msgspec.convert(goal | {"name": name, "unit": unit}, Axis) for name, unit in units)
    view = CameraCalibration(position=(1e-6, 0.0, 0.0), orientation=(1.0, 0.0, 0.0, 0.0), fx=9, fy=9, cx=1, cy=1)
    (camera, *_) = MICRO.cameras
    cameras = tuple(msgspec.structs.replace(camera, name=str(each), calibration=each) for each in (view, None))
    pose = Pose3(name="p", label="", body="", point=(0.0, 1e-6, 0.0), position=("x", "", ""))
    robot = msgspec.structs.replace(MICRO, axes=axes, cameras=cameras, poses=(pose,))
    scale = SceneScale(robot)
    large = scale.description(robot)
    assert large.poses[0].point == pytest.approx((0.0, 1e-6 * scale.factor, 0.0))
    assert large.cameras[0].calibration is not None
    assert large.cameras[0].calibration.position == pytest.approx((1e-6 * scale.factor, 0.0, 0.0))
    assert large.cameras[1].calibration is None
    feedback = msgspec.structs.replace(FEEDBACK, goals=[2e-6, 0.5])
    assert scale.feedback(feedback).goals == pytest.approx([2e-6 * scale.factor, 0.5])
    assert scale.feedback(msgspec.structs.replace(FEEDBACK, goals=[None, 0.5])).goals == [None, 0.5]


@pytest.mark.parametrize("size", [0.0, math.nan, math.inf, 1e300])
def test_sizes_that_make_no_sense_are_left_alone(size: float) -> None:
    body = Body(name="b", parent="", geoms=(Geom(shape="box", size=(size, size, size)),))
    assert SceneScale(RobotDescription(name="r", label="R", axes=(), bodies=(body,))).factor == 1.0


async def test_a_shape_that_cannot_be_built_is_counted_and_the_next_robot_is_shown() -> None:
    metrics = Metrics()
    scene, events = SceneView(15.0, 1, metrics), SessionEvents(metrics.faults)
    scene.subscribe(events)
    tiny = Geom(shape="capsule", size=(1e-12, 1e-12, 0.0), position=(1.0, 0.0, 0.0))
    bad = msgspec.structs.replace(PLANAR, bodies=(Body(name="base", parent="", geoms=(tiny,)),), ranges=None)

    def failures() -> float:
        return sum(
            sample.value
            for metric in metrics.bad_input.collect()
            for sample in metric.samples
            if sample.name.endswith("_total") and sample.labels["where"] == "scene"
        )

    running = asyncio.create_task(scene.run())
    try:
        await scene.open()
        events.publish(EpochBegan(bad))
        await eventually(lambda: failures() == 1)
        events.publish(EpochBegan(msgspec.structs.replace(MICRO, joints=MICRO.joints)))
        await eventually(lambda: scene.renderer.model is not None and "holder" in scene.renderer.model.frames)
        assert not running.done()
    finally:
        running.cancel()
        await asyncio.wait([running])
        await scene.close()


async def test_a_robot_of_many_parts_is_posed_away_from_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    threads: set[int] = set()
    poses = CommandedPath.poses

    def noted(path: CommandedPath) -> dict[str, Pose] | None:
        threads.add(threading.get_ident())
        return poses(path)

    monkeypatch.setattr(CommandedPath, "poses", noted)
    metrics = Metrics()
    scene, events = SceneView(15.0, 1, metrics), SessionEvents(metrics.faults)
    scene.subscribe(events)
    running = asyncio.create_task(scene.run())
    try:
        await scene.open()
        events.publish(EpochBegan(PLANAR))
        with scene.viewer(SceneTicket("link", "observer", math.inf)):
            feedback = Feedback(event=1, issue=1, time=0.0, axes=[0.0] * 3, joints=[0.0] * 3)
            events.publish(FeedbackReceived(feedback, 0.0, None))
            await eventually(lambda: bool(threads))
        assert threading.get_ident() not in threads
    finally:
        running.cancel()
        await asyncio.wait([running])
        await scene.close()


def test_a_robot_that_takes_long_to_pose_is_posed_more_rarely() -> None:
    assert pause(0.001, 1 / 15) == 1 / 15
    assert pause(0.5, 1 / 15) == pytest.approx(1.5)


def test_a_body_on_a_slide_moves_as_far_as_the_rest_is_magnified() -> None:
    slide = next(body for body in MICRO.bodies if body.joints)
    assert isinstance(slide.joints[0], BodyJoint)
    assert SceneScale(MICRO).description(MICRO).bodies[1].joints == slide.joints
