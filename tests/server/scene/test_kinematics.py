import math
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.description import Body, BodyJoint, RobotDescription
from lockstep.server.scene.kinematics import (
    Pose,
    about,
    body_pose,
    product,
    rotate,
    scene_paths,
    world_poses,
    world_positions,
)
from tests.client.control.vectors import load_vectors

QUARTER = math.pi / 2
Z = (0.0, 0.0, 1.0)


def _robot(*bodies: Body) -> RobotDescription:
    return RobotDescription(name="r", label="R", axes=(), bodies=bodies)


def test_joints_act_in_order_in_the_bodys_own_frame() -> None:
    body = Body(
        name="base",
        parent="",
        position=(1.0, 0.0, 0.0),
        joints=(
            BodyJoint(joint="yaw", kind="revolute", axis=Z),
            BodyJoint(joint="forward", kind="prismatic", axis=(1.0, 0.0, 0.0)),
        ),
    )
    pose = body_pose(body, {"yaw": QUARTER, "forward": 2.0})
    assert pose.position == pytest.approx((1.0, 2.0, 0.0))
    assert rotate(pose.orientation, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))


def test_a_joint_without_a_value_is_at_zero() -> None:
    body = Body(name="a", parent="", joints=(BodyJoint(joint="q", kind="revolute", axis=Z),))
    assert body_pose(body, {}) == Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


def test_a_turn_about_no_axis_is_none() -> None:
    assert about((0.0, 0.0, 0.0), 1.0) == (1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("axis", [(5e-324, 0.0, 0.0), (0.0, 5e-324, 5e-324), (1e-310, -2e-310, 3e-320)])
def test_a_turn_about_an_axis_as_short_as_there_is_one_is_a_turn(axis: tuple[float, float, float]) -> None:
    assert math.hypot(*about(axis, 2.0)) == pytest.approx(1.0)
    assert about(axis, 2.0)[0] == pytest.approx(math.cos(1.0))


@given(st.tuples(*[st.floats(-5, 5)] * 3), st.floats(-10, 10), st.tuples(*[st.floats(-5, 5)] * 3))
def test_turning_keeps_lengths_and_turning_back_undoes_it(
    axis: tuple[float, float, float], angle: float, vector: tuple[float, float, float]
) -> None:
    turned = rotate(about(axis, angle), vector)
    assert math.hypot(*turned) == pytest.approx(math.hypot(*vector), abs=1e-6)
    assert rotate(about(axis, -angle), turned) == pytest.approx(vector, abs=1e-6)
    assert product(about(axis, angle), about(axis, -angle)) == pytest.approx((1, 0, 0, 0), abs=1e-6)


def test_paths_nest_parents_first_whatever_the_order() -> None:
    robot = _robot(Body(name="hand", parent="arm"), Body(name="arm", parent="base"), Body(name="base", parent=""))
    assert list(scene_paths(robot).items()) == [
        ("base", "/robot/base"),
        ("arm", "/robot/base/arm"),
        ("hand", "/robot/base/arm/hand"),
    ]


def test_a_long_chain_is_walked_once_and_those_beside_each_other_keep_their_order() -> None:
    names = [f"link{number}" for number in range(1000)]

    class Parent(str):
        looked = 0

        def __hash__(self) -> int:
            Parent.looked += 1
            return super().__hash__()

    parents = ["", *names[:-1]]
    chain = [Body(name=name, parent=Parent(parent)) for name, parent in zip(names, parents, strict=True)]
    found = scene_paths(_robot(*reversed(chain), Body(name="b", parent="link0"), Body(name="a", parent="link0")))
    assert list(found)[:4] == ["link0", "link1", "b", "a"]
    assert found["link999"].count("/") == 1001
    assert Parent.looked < 20 * len(names)


def test_orphans_and_circles_are_left_out() -> None:
    robot = _robot(
        Body(name="a", parent="b"),
        Body(name="b", parent="a"),
        Body(name="c", parent="nobody"),
        Body(name="d", parent=""),
    )
    assert scene_paths(robot) == {"d": "/robot/d"}


def test_world_positions_follow_the_chain() -> None:
    robot = _robot(
        Body(name="base", parent="", joints=(BodyJoint(joint="yaw", kind="revolute", axis=Z),)),
        Body(name="arm", parent="base", position=(1.0, 0.0, 0.5)),
    )
    assert world_positions(robot, {"yaw": QUARTER})[1] == pytest.approx((0.0, 1.0, 0.5))


POSES: dict[str, Any] = load_vectors("poses.json")


@pytest.mark.parametrize("case", POSES["cases"])
def test_bodies_stand_where_the_replay_page_draws_them(case: dict[str, Any]) -> None:
    robot = _robot(*msgspec.convert(POSES["bodies"], tuple[Body, ...]))
    poses = world_poses(robot, dict(zip(POSES["joints"], case["joints"], strict=True)))
    assert set(poses) == set(case["positions"])
    for name, position in case["positions"].items():
        assert poses[name].position == pytest.approx(position, abs=1e-6)
