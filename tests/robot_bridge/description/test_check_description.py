import math
from typing import Any

import msgspec
import pytest

from lockstep.protocol.description import (
    Axis,
    Binding,
    Body,
    BodyJoint,
    BodyTwist,
    Camera,
    CameraCalibration,
    ControlLayer,
    ForceFeeling,
    Geom,
    Joint,
    Microphone,
    RobotDescription,
)
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

AXIS = Axis(name="a", label="A", unit="m/s", minimum=-1, maximum=1, slew=4, brake=10)


def with_axis(**changes: object) -> RobotDescription:
    return RobotDescription(name="r", label="R", axes=(msgspec.structs.replace(AXIS, **changes),))


def with_change(**changes: object) -> RobotDescription:
    return msgspec.structs.replace(DESCRIPTION, **changes)


def _camera(**changes: object) -> Camera:
    return msgspec.structs.replace(DESCRIPTION.cameras[0], **changes)


def with_mesh(vertices: tuple[float, ...], triangles: tuple[int, ...], shape: Any = "mesh") -> RobotDescription:
    geom = Geom(shape=shape, vertices=vertices, triangles=triangles)
    return with_change(bodies=(*DESCRIPTION.bodies, Body(name="m", parent="", geoms=(geom,))))


def test_a_mesh_is_sound() -> None:
    check_description(with_mesh((0, 0, 0, 1, 0, 0, 0, 1, 0), (0, 1, 2)))


def test_the_planar_robots_description_is_sound() -> None:
    check_description(DESCRIPTION)
    check_description(with_axis())


@pytest.mark.parametrize(
    ("description", "message"),
    [
        (with_change(axes=()), "at least one axis"),
        (with_change(bodies=tuple(Body(name=f"{each:0200}", parent="") for each in range(300))), "bytes of JSON"),
        (with_change(hold=0.0), "hold"),
        (with_change(hold=math.nan), "hold"),
        (with_change(max_event_age=11.0), "max_event_age"),
        (with_change(max_event_rate=0.0), "max_event_rate"),
        (with_axis(maximum=math.inf), "finite"),
        (with_axis(slew=math.nan), "finite"),
        (with_axis(rest=2.0), "rest must lie"),
        (with_axis(minimum=1.0, maximum=-1.0), "rest must lie"),
        (with_axis(slew=0.0), "positive"),
        (with_axis(brake=-1.0), "positive"),
        (with_axis(brake=3.0), "longer than hold"),
        (with_change(axes=(AXIS, AXIS), layers=()), "axis name 'a'"),
        (with_change(joints=(Joint(name="", unit="m"),)), "joint name ''"),
        (with_change(microphones=(Microphone(name="front", label="F", sample_rate=8000),)), "stream name 'front'"),
        (with_change(cameras=DESCRIPTION.cameras * 2), "stream name"),
        (with_change(axes=tuple(with_axis(name=f"a{n}").axes[0] for n in range(300)), layers=()), "300 axes"),
        (with_change(cameras=tuple(_camera(name=f"c{n}") for n in range(40)), microphones=()), "40 cameras"),
        (with_change(cameras=(_camera(width=65_535),)), "65535x"),
        (with_change(cameras=(_camera(frame_rate=math.nan),)), "frame_rate"),
        (with_change(cameras=(_camera(label="ok\x1b[2J"),)), "cannot be printed"),
        (with_change(label="\u202eknalP"), "cannot be printed"),
        (with_change(label="x" * 201), "201 characters"),
        (with_change(microphones=(Microphone(name="m", label="M", sample_rate=0),)), "0 Hz"),
        (with_change(bodies=(Body(name="a", parent="b"), Body(name="b", parent="a"))), "part of itself"),
        (with_mesh((0, 0, 0, 1, 0, 0, 0, 1, 0), (0, 1, 3)), "does not have"),
        (with_mesh((0, 0, 0, 1, 0, 0, 0, 1, 0), (0, 1, -1)), "does not have"),
        (with_mesh((0, 0, 0, 1, 0, 0, 0, 1), (0, 1, 2)), "three numbers"),
        (with_mesh((0, 0, 0, 1, 0, 0, 0, 1, 0), (0, 1)), "three numbers"),
        (with_mesh((), ()), "three numbers"),
        (with_mesh((0, 0, 0, 1, 0, 0, 0, 1, math.inf), (0, 1, 2)), "body m: every number"),
        (with_mesh((0.0,) * 30_000, (0,) * 30_003), "60003 numbers of meshes"),
        (with_mesh((0.0,) * 15_000, (0,) * 15_003), "30003 numbers of meshes, the bound is 30000"),
        (
            with_mesh((0.123,) * 9_000, (0,) * 3_000),
            "fewer triangles, for the meshes have 600",
        ),
        (with_mesh((0, 0, 0, 1, 0, 0, 0, 1, 0), (0, 1, 2), "box"), "a box has no vertices"),
        (with_change(bodies=(Body(name="a", parent="", position=(0.0, math.nan, 0.0)),)), "body a: every number"),
        (
            with_change(cameras=(msgspec.structs.replace(DESCRIPTION.cameras[0], metres_per_pixel=0.0),)),
            "metres_per_pixel must be positive",
        ),
        (
            with_change(layers=(ControlLayer(name="l", label="L", bindings=(Binding(axis="arm"),)),)),
            "layer l names the axis 'arm'",
        ),
        (with_change(bodies=(*DESCRIPTION.bodies, Body(name="x", parent="nobody"))), "body 'nobody'"),
        (
            with_change(
                bodies=(
                    *DESCRIPTION.bodies,
                    Body(name="x", parent="", joints=(BodyJoint(joint="j", kind="revolute", axis=(0, 0, 1)),)),
                )
            ),
            "joint 'j'",
        ),
        (with_change(force_feeling=ForceFeeling(threshold_newtons=5, full_newtons=5)), "threshold_newtons < full"),
        (with_change(force_feeling=ForceFeeling(threshold_newtons=math.nan, full_newtons=5)), "threshold_newtons"),
        (with_change(force_feeling=ForceFeeling(threshold_newtons=1, full_newtons=math.inf)), "both finite"),
        (with_change(force_feeling=ForceFeeling(threshold_newtons=1, full_newtons=5, curve=0)), "curve"),
        (with_change(body_twists=(BodyTwist(body=""),)), "the twist of  names the body ''"),
        (with_change(body_twists=(BodyTwist(body="base", frame="x"),)), "the body 'x'"),
        (with_change(body_twists=(BodyTwist(body="base", linear=("x", "", "")),)), "the axis 'x'"),
        (with_change(body_twists=(BodyTwist(body="base", point=(math.inf, 0, 0)),)), "point must be finite"),
        (with_change(bodies=()), "sensor bumper names the body 'base'"),
    ],
)
def test_a_contradiction_is_named(description: RobotDescription, message: str) -> None:
    with pytest.raises(DescriptionError, match=message):
        check_description(description)


def test_a_camera_and_a_microphone_are_both_streams() -> None:
    camera = Camera(name="c", label="C", width=2, height=2, frame_rate=1)
    check_description(with_change(cameras=(camera,), microphones=()))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fx": 0.0}, "needs focal lengths above 0"),
        ({"cx": float("nan")}, "must be finite"),
        ({"position": (0.0, 0.0, 1e7)}, "must be finite and at most"),
        ({"distortion": (0.0,) * 15}, "15 coefficients of distortion"),
        ({"body": "nowhere"}, "names the body 'nowhere'"),
        ({"distortion_model": "a\nb"}, "cannot be printed"),
    ],
)
def test_a_calibration_that_no_viewer_could_use_is_named(change: dict[str, Any], message: str) -> None:
    whole = CameraCalibration(fx=1.0, fy=1.0, cx=1.0, cy=1.0)
    camera = Camera(name="c", label="C", width=2, height=2, frame_rate=1, calibration=whole)
    check_description(with_change(cameras=(camera,), microphones=()))
    broken = msgspec.structs.replace(camera, calibration=msgspec.structs.replace(whole, **change))
    with pytest.raises(DescriptionError, match=message):
        check_description(with_change(cameras=(broken,), microphones=()))
