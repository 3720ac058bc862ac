"""Where commands alone would have brought a robot, against motions that are known by hand."""

import math
from typing import Any

import msgspec
import pytest

from lockstep.protocol.description import (
    Axis,
    AxisGain,
    Body,
    BodyJoint,
    BodyTwist,
    Camera,
    CameraCalibration,
    Joint,
    PlanarBase,
    Pose,
    PositionLimit,
    RobotDescription,
)
from lockstep.protocol.messages import Feedback, StopState
from lockstep.server.scene.commanded_path import CommandedPath
from tests.makers import goal_axis

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def _axis(name: str) -> Axis:
    return Axis(name=name, label=name, unit="m/s", minimum=-2, maximum=2, slew=10, brake=20)


BASE = RobotDescription(
    name="r",
    label="R",
    axes=(_axis("vx"), _axis("vy"), _axis("wz")),
    joints=(Joint(name="x", unit="m"), Joint(name="y", unit="m"), Joint(name="yaw", unit="rad")),
    bodies=(
        Body(
            name="base",
            parent="",
            joints=(
                BodyJoint(joint="x", kind="prismatic", axis=X),
                BodyJoint(joint="y", kind="prismatic", axis=Y),
                BodyJoint(joint="yaw", kind="revolute", axis=Z),
            ),
        ),
        Body(name="tool", parent="base", position=(1.0, 0.0, 0.0)),
    ),
    planar_base=PlanarBase(x="x", y="y", yaw="yaw", forward="vx", left="vy", turn="wz"),
    hold=0.3,
)
LIFT = RobotDescription(
    name="r",
    label="R",
    axes=(_axis("up"),),
    joints=(Joint(name="z", unit="m"),),
    bodies=(Body(name="lift", parent="", joints=(BodyJoint(joint="z", kind="prismatic", axis=Z),)),),
    position_limits=(
        PositionLimit(name="l", label="L", joint="z", maximum=1, axes=(AxisGain(axis="up", gain=-2.0),)),
        PositionLimit(name="m", label="M", joint="z", minimum=0, axes=(AxisGain(axis="up", gain=-2.0),)),
    ),
)


def _fed(path: CommandedPath, event: int, time: float, joints: list[float], **values: object) -> None:
    state = {"event": event, "issue": 1, "time": time, "axes": [], "joints": joints, "at_rest": False, **values}
    path.feedback(Feedback(**state))  # type: ignore[arg-type]


def _driven(description: RobotDescription, values: list[float], joints: list[float], steps: int = 4) -> CommandedPath:
    """The robot is told to move and does not; a feedback every 0.1 s."""
    path = CommandedPath(description)
    for event in range(1, steps + 1):
        path.command(event, values)
        _fed(path, event, event * 0.1, joints)
    return path


def test_a_blocked_base_would_be_ahead_by_its_speed_for_as_long_as_a_command_is_held() -> None:
    poses = _driven(BASE, [1.0, 0.0, 0.0], [2.0, 3.0, math.pi / 2], 9).poses()
    assert poses is not None
    assert poses["base"].position == pytest.approx((2.0, 3.3, 0.0))
    assert poses["tool"].position == pytest.approx((2.0, 4.3, 0.0))


def test_a_base_that_turns_drives_an_arc() -> None:
    poses = _driven(BASE, [1.0, 0.0, 1.0], [0.0, 0.0, 0.0], 9).poses()
    assert poses is not None
    x, y, _ = poses["base"].position
    assert (x, y) == pytest.approx((math.sin(0.3), 1 - math.cos(0.3)), abs=2e-4)


def test_a_joint_moves_by_its_gain() -> None:
    poses = _driven(LIFT, [0.5], [0.2]).poses()
    assert poses is not None
    assert poses["lift"].position == pytest.approx((0.0, 0.0, 0.2 - 0.3))


def test_a_robot_that_follows_is_where_it_was_told_to_be() -> None:
    path = CommandedPath(LIFT)
    for event in range(1, 6):
        path.command(event, [0.5])
        _fed(path, event, event * 0.1, [1.0 - event * 0.1])
    poses = path.poses()
    assert poses is not None
    assert poses["lift"].position == pytest.approx((0.0, 0.0, 0.5))


def test_a_twist_moves_its_body_in_the_frame_that_it_is_given_in() -> None:
    twist = BodyTwist(body="tool", frame="base", point=(0.5, 0, 0), linear=("vx", "", ""), angular=("", "", "wz"))
    robot = RobotDescription(
        name="r", label="R", axes=BASE.axes, joints=BASE.joints, bodies=BASE.bodies, body_twists=(twist,)
    )
    poses = _driven(robot, [1.0, 0.0, 0.0], [0.0, 0.0, math.pi / 2]).poses()
    assert poses is not None
    assert poses["base"].position == pytest.approx((0.0, 0.0, 0.0))
    assert poses["tool"].position == pytest.approx((0.0, 1.3, 0.0))
    turned = _driven(robot, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]).poses()
    assert turned is not None
    # The point stays, the body turns about it.
    assert turned["tool"].position == pytest.approx((1.5 - 0.5 * math.cos(0.3), -0.5 * math.sin(0.3), 0.0))


@pytest.mark.parametrize("rest", [{"at_rest": True}, {"stop": StopState(stopped=True)}])
def test_at_rest_nothing_is_commanded(rest: dict[str, object]) -> None:
    path = CommandedPath(LIFT)
    for event in range(1, 5):
        path.command(event, [0.5])
        _fed(path, event, event * 0.1, [0.0], **rest)
    assert path.poses() is None


def test_neutral_commands_and_events_of_nobody_here_are_none() -> None:
    assert _driven(LIFT, [0.0], [0.0]).poses() is None
    path = CommandedPath(LIFT)
    _fed(path, 1, 0.1, [0.0])
    _fed(path, 2, 0.2, [0.0])
    assert path.poses() is None


def test_a_command_counts_no_longer_than_the_robot_holds_it() -> None:
    path = CommandedPath(LIFT)
    path.command(1, [0.5])
    _fed(path, 1, 0.1, [0.0])
    _fed(path, 1, 9.0, [0.0])
    poses = path.poses()
    assert poses is None or poses["lift"].position[2] >= -0.3


def test_a_description_that_says_nothing_about_its_axes_has_no_ghost() -> None:
    robot = RobotDescription(name="r", label="R", axes=LIFT.axes, joints=LIFT.joints, bodies=LIFT.bodies)
    path = _driven(robot, [1.0], [0.0])
    assert (path.known, path.poses()) == (False, None)


def test_feedback_that_makes_no_sense_is_left_out_and_a_clock_that_goes_back_begins_anew() -> None:
    path = _driven(LIFT, [0.5], [0.0])
    _fed(path, 5, 0.5, [math.nan])
    _fed(path, 5, math.inf, [0.0])
    _fed(path, 1, 0.0, [0.7])
    assert path.poses() is None


def test_what_is_kept_is_bounded() -> None:
    path = CommandedPath(LIFT)
    for event in range(1, 2000):
        path.command(event, [0.5])
        _fed(path, event, event * 1e-4, [0.0])
    assert len(path._records) <= 256
    assert len(path._commands) <= 512


def test_what_it_is_now_stays_so_for_another_thread() -> None:
    path = _driven(LIFT, [0.5], [0.2])
    kept = path.as_of_now()
    path.command(5, [-0.5])
    _fed(path, 5, 0.5, [0.9])
    poses, later = kept.poses(), path.poses()
    assert poses is not None
    assert later is not None
    assert poses["lift"].position == pytest.approx((0.0, 0.0, 0.2 - 0.3))
    assert later["lift"].position != poses["lift"].position


def _goal_axis(name: str, wrap: float | None = None) -> Axis:
    return goal_axis(name, most=1, reach=0.5, wrap=wrap)


ARM = RobotDescription(
    name="r",
    label="R",
    axes=(_goal_axis("shoulder"), _goal_axis("up"), *map(_goal_axis, ("px", "py", "pz", "rx", "ry", "rz"))),
    joints=(Joint(name="shoulder", unit="rad"), Joint(name="z", unit="m")),
    bodies=(
        Body(name="lift", parent="", joints=(BodyJoint(joint="z", kind="prismatic", axis=Z),)),
        Body(name="arm", parent="lift", joints=(BodyJoint(joint="shoulder", kind="revolute", axis=Z),)),
        Body(name="tool", parent="arm", position=(1.0, 0.0, 0.0)),
    ),
    position_limits=LIFT.position_limits,
    poses=(
        Pose(
            name="tool",
            label="Tool",
            body="tool",
            frame="lift",
            point=(0.5, 0.0, 0.0),
            position=("px", "py", "pz"),
            rotation=("rx", "ry", "rz"),
            instead_of=("shoulder", "up"),
        ),
    ),
)
NULLS: list[float | None] = [None] * 6


def _at(
    path: CommandedPath, values: list[float | None], goals: list[float | None], axes: list[float], **rest: object
) -> None:
    path.command(2, values)
    tool = [1.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    _fed(path, 2, 1.0, axes, axes=[*axes, *tool], goals=[*goals, *tool], **rest)


def seen_by(camera: str, **calibration: Any) -> RobotDescription:
    """The arm, whose tool's goals are in the frame of the camera "eye"."""
    view = CameraCalibration(fx=1, fy=1, cx=0, cy=0, **calibration)
    eye = Camera(name="eye", label="Eye", width=64, height=48, frame_rate=1, calibration=view)
    poses = (msgspec.structs.replace(ARM.poses[0], frame=camera),)
    return msgspec.structs.replace(ARM, poses=poses, cameras=(eye,))


@pytest.mark.parametrize("length", [1.0, 2.0])
def test_a_tool_is_drawn_where_its_goal_is_in_the_frame_of_a_camera_on_a_body_that_moves(length: float) -> None:
    half = length * math.sqrt(0.5)
    path = CommandedPath(seen_by("eye", body="lift", position=(0.0, 0.0, 2.0), orientation=(half, half, 0.0, 0.0)))
    tool = [1.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    path.command(2, [None, None, 0.9, 0.3, 0.4, 0.0, 0.0, 0.0])
    _fed(path, 2, 1.0, [0.0, 0.5], axes=[0.0, 0.5, *tool], goals=[0.0, 0.5, *tool])
    poses = path.poses()
    assert poses is not None
    # A quarter of a turn about x: the camera's y is the world's z, its z looks along the world's -y.
    assert poses["tool"].position == pytest.approx((0.4, -0.4, 0.5 + 2.0 + 0.3))


def test_a_tool_whose_camera_hangs_on_no_known_body_stays_where_it_was_measured() -> None:
    path = CommandedPath(seen_by("eye", body="roof", orientation=(1.0, 0.0, 0.0, 0.0)))
    tool = [1.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    path.command(2, [None, None, 0.9, 0.3, 0.4, 0.0, 0.0, 0.0])
    _fed(path, 2, 1.0, [0.0, 0.5], axes=[0.0, 0.5, *tool], goals=[0.0, 0.5, *tool])
    poses = path.poses()
    assert poses is not None
    assert poses["tool"].position == pytest.approx((1.0, 0.0, 0.5))


def test_a_goal_axis_is_drawn_where_its_newest_command_wants_it_within_its_range() -> None:
    path = CommandedPath(ARM)
    _at(path, [0.25, 7.0, *NULLS], [0.1, 0.1], [0.1, 0.1])
    poses = path.poses()
    assert poses is not None
    assert poses["lift"].position == pytest.approx((0, 0, 0.1 - 2 * 0.9))  # by the gain of the position limit
    assert poses["tool"].position[:2] == pytest.approx((math.cos(0.25), math.sin(0.25)))


def test_a_goal_axis_that_stays_is_drawn_where_it_stays_until_the_robot_is_at_rest() -> None:
    path = CommandedPath(ARM)
    _at(path, [None, None, *NULLS], [0.5, 0.1], [0.25, 0.1])
    poses = path.poses()
    assert poses is not None
    assert poses["tool"].position[:2] == pytest.approx((math.cos(0.5), math.sin(0.5)))
    _at(path, [None, None, *NULLS], [0.5, 0.1], [0.25, 0.1], at_rest=True)
    assert path.poses() is None


def test_goals_that_are_a_pose_draw_its_body_there_and_leave_the_joints_alone() -> None:
    path = CommandedPath(ARM)
    _at(path, [None, None, 1.0, 0.5, 0.25, 0.0, 0.0, math.pi / 4], [0.5, 0.5], [0.0, 0.1])
    poses = path.poses()
    assert poses is not None
    assert poses["arm"].orientation == pytest.approx((1, 0, 0, 0))
    assert poses["lift"].position == pytest.approx((0, 0, 0.1))
    back = 0.5 * math.sqrt(0.5)  # the point is half a metre ahead of the body
    assert poses["tool"].position == pytest.approx((1.0 - back, 0.5 - back, 0.35))
    assert poses["tool"].orientation == pytest.approx((math.cos(math.pi / 8), 0, 0, math.sin(math.pi / 8)))


def test_a_goal_across_the_border_of_an_axis_that_turns_on_and_on_is_drawn_the_shorter_way() -> None:
    description = RobotDescription(
        name="r",
        label="R",
        axes=(_goal_axis("shoulder", wrap=2 * math.pi),),
        joints=ARM.joints[:1],
        bodies=(Body(name="arm", parent="", joints=(BodyJoint(joint="shoulder", kind="revolute", axis=Z),)),),
    )
    path = CommandedPath(description)
    path.command(2, [-3.0])
    _fed(path, 2, 1.0, [3.0], axes=[3.0], goals=[3.0])
    poses = path.poses()
    assert poses is not None
    turn = poses["arm"].orientation
    assert 2 * math.atan2(turn[3], turn[0]) == pytest.approx(2 * math.pi - 3.0)


def test_a_command_without_the_feedback_s_goals_says_nothing_of_where_goal_axes_stay() -> None:
    path = CommandedPath(ARM)
    path.command(2, [0.5, None, *NULLS])
    _fed(path, 2, 1.0, [0.0, 0.0], axes=[0.0] * 8)
    assert path.poses() is None


def test_what_a_shadow_wants_is_shown_by_its_goals_also_while_the_robot_rests() -> None:
    arm = RobotDescription(
        name="r",
        label="R",
        axes=(goal_axis("turn", most=3.0, reach=1.0), _axis("vx")),
        joints=(Joint(name="turn", unit="rad"),),
        bodies=(Body(name="arm", parent="", joints=(BodyJoint(joint="turn", kind="revolute", axis=Z),)),),
    )
    path = CommandedPath(arm)
    assert path.wanted([0.5, None]) is None, "no feedback yet"
    path.feedback(
        Feedback(
            event=1,
            issue=1,
            time=1.0,
            axes=[0.1, 0.0],
            joints=[0.1],
            goals=[0.1, None],
            at_rest=True,
            stop=StopState(stopped=False),
        )
    )
    wanted = path.wanted([0.5, None])
    assert wanted is not None
    assert wanted["arm"].orientation == pytest.approx((math.cos(0.25), 0.0, 0.0, math.sin(0.25)))
    assert path.wanted([None, 1.0]) is None, "a rate says no place"
