import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.description import Body, Geom
from lockstep.robot_bridge.kinematics.body_capsules import body_capsules
from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.obstacles import Obstacle, Obstacles, Surface, plane
from lockstep.robot_bridge.kinematics.rotations import from_rotation_vector
from lockstep.robot_bridge.kinematics.surfaces import body_surfaces
from tests.robot_bridge.kinematics.arms import DESK_ARM, desk_arm, revolute

STEP = 1e-6
FAR = 9.0  # m
ARM = desk_arm()
FINGER = {"hand": Surface(np.array(((0.16, 0.0, 0.0),)), np.array((0.01,)))}
postures = st.tuples(*(st.floats(-1.5, 1.5) for _ in range(5)))
TURN = from_rotation_vector((0.2, 0.5, -0.4))
BOX = Obstacle("the box", np.array((0.2, 0.05, 0.1)), TURN, np.array((0.1, 0.05, 0.07)))


def test_the_gap_to_a_plane_is_the_height_above_it() -> None:
    table = Obstacles(ARM, FINGER, (plane("the table", (5.0, -3.0, 0.02), (0.0, 0.0, 4.0)),))
    state = ARM.at((0.3, 0.2, 0.4, 0.1, 0.0))
    (gap,) = table.gaps(state, FAR)
    assert gap.distance == pytest.approx(state.position[2] - 0.03)
    assert gap.what == "the table"
    assert table.gaps(state, gap.distance - 1e-6) == []


@given(postures)
def test_the_gap_to_a_box_is_the_way_to_its_nearest_place(posture: tuple[float, ...]) -> None:
    state = ARM.at(posture)
    own = TURN.T @ (state.position - BOX.position)
    nearest = np.clip(own, -BOX.half, BOX.half)
    (gap,) = Obstacles(ARM, FINGER, (BOX,)).gaps(state, FAR)
    depth = float(min(0.0, (np.abs(own) - BOX.half).max()))
    assert gap.distance == pytest.approx(np.linalg.norm(own - nearest) + depth - 0.01)


@given(postures)
def test_the_gradient_of_a_gap_is_its_derivative(posture: tuple[float, ...]) -> None:
    around = Obstacles(ARM, FINGER, (BOX, plane("the table", (0.0, 0.0, 0.0), (0.1, 0.0, 1.0))))
    gaps = around.gaps(ARM.at(posture), FAR)
    assert len(gaps) == 2
    for joint in range(5):
        ways = []
        for sign in (1, -1):
            moved = [value + sign * STEP * (number == joint) for number, value in enumerate(posture)]
            ways.append([gap.distance for gap in around.gaps(ARM.at(moved), FAR)])
        for gap, ahead, behind in zip(gaps, *ways, strict=True):
            sides = sorted(((ahead - gap.distance) / STEP, (gap.distance - behind) / STEP))
            assert sides[0] - 1e-4 <= gap.gradient[joint] <= sides[1] + 1e-4


@given(postures, st.floats(0.0, 0.5))
def test_the_gaps_that_are_narrow_are_those_of_all_bodies_and_obstacles(
    posture: tuple[float, ...], within: float
) -> None:
    rod = np.array([(0.0, 0.0, 0.04 * number) for number in range(6)])
    surfaces = FINGER | {"upper": Surface(rod, np.full(6, 0.02)), "fore": Surface(rod, np.full(6, 0.03))}
    table = plane("the table", (0.0, 0.0, 0.0), (0.1, 0.0, 1.0))
    around = Obstacles(ARM, surfaces, (BOX, table, BOX._replace(name="another", position=np.array((-0.1, 0.2, 0.4)))))
    state = ARM.at(posture)
    every = around.gaps(state, FAR)
    assert len(every) >= 9  # of three bodies and three obstacles
    narrow = [(gap.what, gap.distance) for gap in around.gaps(state, within)]
    assert narrow == [(gap.what, gap.distance) for gap in every if gap.distance < within]


def test_without_obstacles_or_bodies_there_is_no_gap() -> None:
    state = ARM.at((0.0,) * 5)
    assert Obstacles(ARM, FINGER, ()).gaps(state, FAR) == []
    assert Obstacles(ARM, {}, (BOX,)).gaps(state, FAR) == []


def test_a_body_that_no_joint_moves_has_no_gap() -> None:
    foot = {"foot": Surface(np.zeros((1, 3)), np.zeros(1))}
    assert Obstacles(ARM, foot, (BOX,)).gaps(ARM.at((0.0,) * 5), FAR) == []


@pytest.mark.parametrize("normal", [(0.0, 0.0, 0.0), (math.inf, 0.0, 0.0), (math.nan, 0.0, 1.0)])
def test_a_plane_needs_a_direction(normal: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="no direction"):
        plane("the wall", (0.0, 0.0, 0.0), normal)


def test_the_surface_of_a_body_holds_its_shapes_and_the_fingers_that_hang_on_it() -> None:
    shapes = (
        Geom(shape="box", size=(0.03, 0.02, 0.01)),
        Geom(shape="sphere", size=(0.05, 0, 0), position=(0.1, 0, 0)),
        Geom(shape="capsule", size=(0.01, 0.1, 0)),
        Geom(shape="cylinder", size=(0.02, 0.04, 0)),
    )
    finger = Body(
        name="finger", parent="tip", position=(0.2, 0, 0), joints=(revolute("grip", (0, 0, 1)),), geoms=shapes[1:2]
    )
    bodies = (*DESK_ARM, Body(name="tip", parent="hand", position=(0.0, 0.0, 1.0), geoms=shapes), finger)
    surfaces = body_surfaces(bodies, Chain(bodies, "hand"))
    assert surfaces.keys() == {"hand"}
    points, radii = surfaces["hand"]
    assert (points.max(axis=0) - (0.0, 0.0, 1.0))[1:] == pytest.approx((0.02, 0.1))
    assert radii.max() == 0.05
    assert points[np.argmax(points[:, 0])].tolist() == pytest.approx((0.3, 0.0, 1.0))


@given(postures, st.tuples(*(st.floats(-0.3, 0.3) for _ in range(5))), st.floats(0.0, 0.2))
def test_gaps_that_a_motion_of_the_joints_would_make_narrow_are_near_as_well(
    posture: tuple[float, ...], motion: tuple[float, ...], within: float
) -> None:
    rod = np.array([(0.0, 0.0, 0.04 * number) for number in range(6)])
    surfaces = FINGER | {"upper": Surface(rod[:1], np.full(1, 0.02)), "fore": Surface(rod[:1], np.full(1, 0.03))}
    around = Obstacles(ARM, surfaces, (BOX, plane("the table", (0.0, 0.0, 0.0), (0.1, 0.0, 1.0))))
    state, ahead = ARM.at(posture), np.array(motion)
    near = {(gap.what, gap.distance) for gap in around.gaps(state, within, ahead)}
    for gap in around.gaps(state, FAR):
        left = gap.distance + min(0.0, float(gap.gradient @ ahead))
        assert ((gap.what, gap.distance) in near) == (left < within) or abs(left - within) < 1e-9


def test_a_mesh_is_kept_off_as_the_box_around_it_and_its_capsule_holds_all_of_it() -> None:
    mesh = Geom(shape="mesh", vertices=(0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.4, 0.6), triangles=(0, 1, 2))
    box = Geom(shape="box", size=(0.1, 0.2, 0.3), position=(0.1, 0.2, 0.3))
    meshed, boxed = [
        (Body(name="hand", parent="", joints=(revolute("turn", (0.0, 0.0, 1.0)),), geoms=(geom,)),)
        for geom in (mesh, box)
    ]
    found, wanted = [body_surfaces(bodies, Chain(bodies, "hand"))["hand"] for bodies in (meshed, boxed)]
    assert found.points == pytest.approx(wanted.points)
    capsule = body_capsules(meshed)["hand"]
    start, end = np.array(capsule.start), np.array(capsule.end)
    for corner in np.array(mesh.vertices).reshape(-1, 3):
        along = np.clip(np.dot(corner - start, end - start) / np.dot(end - start, end - start), 0, 1)
        assert np.linalg.norm(corner - start - along * (end - start)) <= capsule.radius + 1e-9
