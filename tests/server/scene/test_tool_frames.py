"""Where the frames of tools are: as measured, and where they are to be."""

import math

import pytest

from lockstep.protocol.description import Axis, Camera, CameraCalibration, Pose, RobotDescription
from lockstep.server.scene.kinematics import Pose as Place
from lockstep.server.scene.tool_frames import goal_pose, tool_place

NAMES = ("x", "y", "z", "rx", "ry", "rz")
AXES = tuple(
    Axis(name=name, label=name, unit="", minimum=-9, maximum=9, slew=1, brake=1, kind="goal") for name in NAMES
)
POSE = Pose(
    name="tool", label="Tool", body="hand", point=(0.0, 0.0, 0.1), position=("x", "y", "z"), rotation=("rx", "ry", "rz")
)
QUARTER = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)  # about y
BODIES = {"hand": Place((1.0, 0.0, 0.0), QUARTER), "base": Place((0.0, 5.0, 0.0), (1.0, 0.0, 0.0, 0.0))}
VIEW = CameraCalibration(body="base", position=(0.0, 0.0, 2.0), orientation=QUARTER, fx=1, fy=1, cx=0, cy=0)
ROBOT = RobotDescription(
    name="arm",
    label="Arm",
    axes=AXES,
    cameras=(
        Camera(name="seen", label="", width=64, height=48, frame_rate=1, calibration=VIEW),
        Camera(name="lost", label="", width=64, height=48, frame_rate=1),
    ),
)


def goal(frame: str = "", goals: tuple[float | None, ...] = (0.1, 0.2, 0.3, 0.0, 0.0, 1.0), **fields: object) -> Place:
    found = goal_pose(ROBOT, posed(frame, **fields), list(goals), BODIES)
    assert found is not None
    return found


def posed(frame: str = "", **fields: object) -> Pose:
    return Pose(**{name: getattr(POSE, name) for name in POSE.__struct_fields__} | {"frame": frame} | fields)


def test_a_tool_is_at_its_point_of_its_body() -> None:
    place = tool_place(POSE, BODIES)
    assert place is not None
    assert place.position == pytest.approx((1.1, 0.0, 0.0))
    assert tool_place(posed(body="foot"), BODIES) is None


@pytest.mark.parametrize(
    ("frame", "position"),
    [("", (0.1, 0.2, 0.3)), ("base", (0.1, 5.2, 0.3)), ("seen", (0.3, 5.2, 1.9))],
)
def test_a_goal_is_in_the_frame_of_its_pose(frame: str, position: tuple[float, float, float]) -> None:
    assert goal(frame).position == pytest.approx(position)


def test_a_pose_without_rotation_turns_as_measured() -> None:
    assert goal(rotation=("", "", "")).orientation == pytest.approx(QUARTER)


def test_a_goal_that_is_not_known_is_none() -> None:
    assert goal_pose(ROBOT, posed("lost"), [0.0] * 6, BODIES) is None
    assert goal_pose(ROBOT, POSE, [], BODIES) is None
    assert goal_pose(ROBOT, POSE, [0.0, None, 0.0], BODIES) is None
    assert goal_pose(ROBOT, posed(body="foot"), [0.0] * 6, BODIES) is None
