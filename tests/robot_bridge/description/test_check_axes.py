"""Which goal axes and poses make sense."""

import math
from typing import Any

import msgspec
import pytest

from lockstep.protocol.description import BodyTwist, Camera, PlanarBase, Pose, RobotDescription, StartWarning
from lockstep.robot_bridge.description.check_axes import check_braking
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError
from tests.robot_bridge.control.goals.goal_helpers import ARM_AXES, SHOULDER, TURN, HangingArm

ARM = HangingArm().describe()
TOOL = ARM.poses[0]
EYE = Camera(name="tool", label="Tool", width=64, height=48, frame_rate=1)  # named like a body


def changed(**fields: Any) -> RobotDescription:
    return msgspec.structs.replace(ARM, **fields)


def with_axis(**fields: Any) -> RobotDescription:
    axis = msgspec.structs.replace(SHOULDER, **fields)
    return changed(axes=(ARM_AXES[0], axis, *ARM_AXES[2:]))


def with_turn(**fields: Any) -> RobotDescription:
    axis = msgspec.structs.replace(TURN, **fields)
    return changed(axes=(*ARM_AXES[:3], axis, *ARM_AXES[4:]))


def with_pose(**fields: Any) -> RobotDescription:
    return changed(poses=(msgspec.structs.replace(TOOL, **fields),))


def twice(**fields: Any) -> RobotDescription:
    return changed(poses=(TOOL, msgspec.structs.replace(TOOL, name="other", **fields)))


@pytest.mark.parametrize(
    "description",
    [
        ARM,
        with_axis(rest=77.0),
        with_axis(minimum=0.5, maximum=0.5),
        with_axis(acceleration=0),
        with_turn(minimum=-math.pi, maximum=math.pi, wrap=math.tau),
        with_turn(reach=math.pi),
        with_pose(instead_of=()),
        with_pose(frame="tool"),
        with_pose(settling=0.2),
    ],
    ids=str,
)
def test_it_makes_sense(description: RobotDescription) -> None:
    check_description(description)


@pytest.mark.parametrize(
    ("brake", "settling", "tick", "fits"),
    [
        (5.0, 0.0, 0.01, True),
        (5.0, 0.0, 0.098, True),
        (5.0, 0.0, 0.099, False),  # a tick may come 2 ms late
        (15.0, 0.2, 0.01, False),
        (1e6, 0, 0.298, False),
    ],
)
def test_each_axis_has_to_be_at_rest_by_the_last_tick_within_hold(
    brake: float, settling: float, tick: float, fits: bool
) -> None:
    """With a brake of 5, the full speed takes 0.2 s to brake; that of the tool takes 0.1 s. `hold` is 0.3 s."""
    axes = tuple(msgspec.structs.replace(axis, brake=max(brake, axis.brake)) for axis in ARM_AXES[2:])
    shoulder = msgspec.structs.replace(SHOULDER, slew=1.0, brake=brake)
    description = changed(
        axes=(msgspec.structs.replace(ARM_AXES[0], brake=1e6), shoulder, *axes),
        poses=(msgspec.structs.replace(TOOL, settling=settling),),
    )
    assert description.hold == 0.3
    if fits:
        check_braking(description, tick)
    else:
        with pytest.raises(DescriptionError, match="longer than hold"):
            check_braking(description, tick)


@pytest.mark.parametrize(
    ("description", "words"),
    [
        (with_axis(reach=0), "axis shoulder: a goal axis needs a reach above 0"),
        (with_axis(reach=math.inf), "axis shoulder: every number must be finite"),
        (with_axis(slew=0), "slew and brake must be positive"),
        (with_axis(brake=-1), "slew and brake must be positive"),
        (with_axis(acceleration=-1), "acceleration must not be negative"),
        (with_axis(minimum=3), "minimum must not be above maximum"),
        (with_axis(brake=4), "braking from 1.5 rad/s takes 0.375 s, longer than hold"),
        (with_turn(wrap=0), "wrap must be positive and finite"),
        (with_turn(wrap=math.nan), "wrap must be positive and finite"),
        (with_turn(minimum=-1), "its range is smaller than the period"),
        (with_turn(reach=3.2), "reach must be at most half of wrap"),
        (with_pose(name=""), "pose name '' is empty or used twice"),
        (with_pose(body="arm"), "pose tool names the body 'arm', which is not described"),
        (with_pose(body=""), "pose tool names the body ''"),
        (
            msgspec.structs.replace(with_pose(frame="tool"), cameras=(EYE,)),
            "pose tool names the frame 'tool', which is a body and a camera",
        ),
        (with_pose(frame="eye"), "pose tool names the frame 'eye', which is no body and no camera"),
        (with_pose(settling=-0.1), "axis x: settling of its pose must be from 0 to less than hold"),
        (with_pose(settling=math.nan), "axis x: settling of its pose must be from 0 to less than hold"),
        (with_pose(settling=0.3), "axis x: settling of its pose must be from 0 to less than hold"),
        (with_pose(settling=0.21), "axis x: braking takes 0.100 s and settling 0.21 s, together longer than hold"),
        (with_pose(point=(0.0, math.nan, 0.0)), "pose tool: its point must be finite"),
        (with_pose(position=("", "", "")), "pose tool has no axes"),
        (with_pose(position=("base", "", "")), "names the axis 'base', which is not a goal axis"),
        (with_pose(position=("q", "", "")), "names the axis 'q', which is not a goal axis"),
        (with_pose(position=("turn", "", "")), "axis turn must have the unit m, not 'rad'"),
        (with_pose(rotation=("x", "", "")), "axis x must have the unit rad, not 'm'"),
        (with_pose(position=("x", "x", "z")), "axis x is in two poses, or twice in one"),
        (with_pose(instead_of=("shoulder", "shoulder")), "an axis is twice in instead_of"),
        (with_pose(instead_of=("base",)), "names the axis 'base', which is not a goal axis"),
        (with_pose(instead_of=("shoulder", "x")), "'x' is an axis of a pose and cannot be in instead_of"),
        (twice(), "axis x is in two poses, or twice in one"),
        (changed(poses=(TOOL, msgspec.structs.replace(TOOL, position=("", "", "")))), "is empty or used twice"),
        (
            changed(start_warning=StartWarning(seconds=1, axis="shoulder", value=1)),
            "start_warning names the axis 'shoulder', which is a goal axis",
        ),
        (
            changed(body_twists=(BodyTwist(body="tool", linear=("x", "", "")),)),
            "the twist of tool names the axis 'x', which is a goal axis",
        ),
        (
            changed(planar_base=PlanarBase(x="a", y="b", yaw="c", forward="base", turn="turn")),
            "planar_base names the axis 'turn', which is a goal axis",
        ),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_said_in_words(description: RobotDescription, words: str) -> None:
    with pytest.raises(DescriptionError) as refused:
        check_description(description)
    assert words in refused.value.detail


def test_two_poses_of_one_arm_may_stand_in_for_the_same_axes() -> None:
    axes = tuple(msgspec.structs.replace(axis, name=f"eye.{axis.name}") for axis in ARM_AXES[4:])
    eye = Pose(
        name="eye", label="Eye", body="tool", position=("eye.x", "", "eye.z"), instead_of=("shoulder", "elbow")
    )  # fmt: skip
    check_description(changed(axes=(*ARM_AXES, *axes), poses=(TOOL, eye)))
