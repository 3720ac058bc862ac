import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.kinematics.chain import Chain, NoChain
from lockstep.robot_bridge.kinematics.rotations import rotation_vector
from tests.robot_bridge.kinematics.arms import DESK_ARM, LIFT, desk_arm

STEP = 1e-6
postures = st.tuples(*(st.floats(-1.6, 1.6) for _ in range(5)))


def test_a_tool_on_a_slide_and_a_turned_joint_is_where_trigonometry_says() -> None:
    state = Chain(LIFT, "tool").at((0.5, math.pi / 2, 0.3))
    assert state.position.tolist() == pytest.approx([-0.4, 0.2, 0.5])
    assert rotation_vector(state.rotation).tolist() == pytest.approx([0.0, 0.0, math.pi], abs=1e-6)
    assert state.linear[:, 0].tolist() == pytest.approx([0.0, 0.0, 1.0])
    assert state.angular[:, [0, 2]] == pytest.approx(np.zeros((3, 2)))


@given(postures)
def test_the_jacobian_is_the_derivative_of_the_pose(posture: tuple[float, ...]) -> None:
    chain = desk_arm()
    state = chain.at(posture)
    for joint in range(5):
        moved = chain.at([value + STEP * (number == joint) for number, value in enumerate(posture)])
        assert (moved.position - state.position) / STEP == pytest.approx(state.linear[:, joint], abs=1e-5)
        turn = rotation_vector(moved.rotation @ state.rotation.T) / STEP
        assert turn == pytest.approx(state.angular[:, joint], abs=1e-5)


@given(postures)
def test_a_point_of_a_body_moves_by_the_joints_before_it(posture: tuple[float, ...]) -> None:
    chain = desk_arm()
    state = chain.at(posture)
    point = chain.point("fore", (0.1, 0.02, 0.0))
    motion = chain.motion(state, point.moving, chain.place(state, point))
    assert not motion[:, 3:].any()
    for joint in range(5):
        moved = chain.at([value + STEP * (number == joint) for number, value in enumerate(posture)])
        way = chain.place(moved, point) - chain.place(state, point)
        assert way / STEP == pytest.approx(motion[:, joint], abs=1e-5)


def test_poses_may_be_in_the_frame_of_a_body() -> None:
    chain = Chain(DESK_ARM, "hand", base="column")
    assert chain.joints == ("lift", "elbow", "flex", "roll")
    assert chain.at((0.0, 0.0, 0.0, 0.0)).position.tolist() == pytest.approx([0.195, 0.0, 0.135])


@pytest.mark.parametrize(("tool", "base"), [("claw", ""), ("hand", "cellar"), ("foot", "hand")])
def test_bodies_that_do_not_hang_on_each_other_are_no_chain(tool: str, base: str) -> None:
    with pytest.raises(NoChain, match=tool):
        Chain(DESK_ARM, tool, base)


def test_a_tool_without_a_joint_is_no_chain() -> None:
    with pytest.raises(NoChain, match="no joints"):
        Chain(DESK_ARM, "foot")


def test_a_point_of_another_body_is_refused() -> None:
    with pytest.raises(NoChain, match="not a part"):
        Chain(DESK_ARM, "fore").point("hand", (0.0, 0.0, 0.0))


@given(postures)
def test_no_tool_is_further_from_where_the_chain_begins_than_it_is_long(posture: tuple[float, ...]) -> None:
    chain = desk_arm()
    assert chain.begins == pytest.approx((0.03, 0.0, 0.1))
    assert np.linalg.norm(chain.at(posture).position - chain.begins) <= chain.length + 1e-9


@given(st.tuples(*(st.floats(-1.5, 1.5) for _ in range(3))), st.tuples(*(st.floats(-1.0, 1.0) for _ in range(3))))
def test_the_twists_of_the_frames_move_a_point_as_the_joints_do(
    posture: tuple[float, ...], motion: tuple[float, ...]
) -> None:
    chain = Chain(LIFT, "tool")
    state = chain.at(posture)
    ways, turns = chain.twists(state, np.array(motion))
    for body in ("carriage", "arm", "tool"):
        point = chain.point(body, (0.1, -0.2, 0.3))
        place = chain.place(state, point)
        moved = ways[point.moving] + np.cross(turns[point.moving], place)
        assert moved == pytest.approx(chain.motion(state, point.moving, place) @ motion)
