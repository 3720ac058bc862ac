"""An arm as it is seen from a place beside it: the same arm, in another frame."""

import math

import numpy as np
import pytest

from lockstep.protocol.description import Body, BodyJoint
from lockstep.robot_bridge.kinematics.chain import Chain, NoChain
from lockstep.robot_bridge.kinematics.obstacles import plane
from lockstep.robot_bridge.kinematics.rotations import from_quaternion
from lockstep.robot_bridge.kinematics.views import view_from

QUARTER = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # about z
TILTED = (0.8, 0.1, -0.5, 0.3)


def turning(joint: str, axis: tuple[float, float, float]) -> tuple[BodyJoint, ...]:
    return (BodyJoint(joint=joint, kind="revolute", axis=axis),)


ROOM = [
    Body(name="cart", parent="", position=(0.0, 3.0, 0.0), orientation=QUARTER, joints=turning("yaw", (0, 0, 1))),
    Body(name="column", parent="cart", position=(0.1, 0.0, 0.4), joints=turning("waist", (0, 0, 1))),
    Body(name="arm", parent="column", position=(0.0, 0.0, 0.2), joints=turning("shoulder", (0, 1, 0))),
    Body(name="hand", parent="arm", position=(0.3, 0.0, 0.0)),
    Body(name="mast", parent="cart", position=(-0.2, 0.0, 0.0), orientation=QUARTER),
    Body(name="wall", parent="", position=(4.0, 0.0, 1.0), orientation=TILTED),
]


@pytest.mark.parametrize("base", ["", "cart"])
def test_a_chain_has_its_poses_in_the_frame_of_the_place(base: str) -> None:
    own = [body for body in ROOM if body.name != "cart"] if base == "" else ROOM
    if base == "":  # the column stands in the room
        own[0] = Body(name="column", parent="", position=(0.1, 0.2, 0.4), joints=ROOM[1].joints)
    view = view_from(own, base, "mast" if base else "wall", (0.0, 0.5, 1.0), TILTED)
    straight, seen = Chain(own, "hand", base), Chain(view.bodies(own), "hand")
    assert seen.joints == straight.joints == ("waist", "shoulder")
    for joints in ((0.0, 0.0), (0.7, -0.4), (-2.0, 1.1)):
        expected, found = straight.at(joints), seen.at(joints)
        assert found.position == pytest.approx(view.rotation.T @ (expected.position - view.position))
        assert found.rotation == pytest.approx(view.rotation.T @ expected.rotation)
        assert found.linear == pytest.approx(view.rotation.T @ expected.linear)
        assert found.angular == pytest.approx(view.rotation.T @ expected.angular)


def test_a_place_is_where_its_body_has_it_in_the_bases_frame() -> None:
    view = view_from(ROOM, "cart", "mast", (1.0, 0.0, 0.5), TILTED)
    assert view.position == pytest.approx((-0.2, 1.0, 0.5))
    assert view.rotation == pytest.approx(from_quaternion(QUARTER) @ from_quaternion(TILTED))


@pytest.mark.parametrize(
    ("base", "body", "words"),
    [
        ("cart", "hand", "a joint moves hand against cart"),
        ("cart", "wall", "wall does not stand on cart"),
        ("cart", "", "the world does not stand on cart"),
        ("", "mast", "a joint moves mast against the world"),
        ("", "roof", "roof does not stand on the world"),
    ],
)
def test_a_place_that_moves_against_the_arms_base_is_refused(base: str, body: str, words: str) -> None:
    with pytest.raises(NoChain, match=words):
        view_from(ROOM, base, body, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


def test_bodies_that_hang_on_each_other_are_refused() -> None:
    ring = [Body(name="a", parent="b"), Body(name="b", parent="a")]
    with pytest.raises(NoChain, match="does not stand on"):
        view_from(ring, "", "a", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


def test_an_obstacle_is_where_it_was() -> None:
    view = view_from(ROOM, "", "wall", (0.0, 0.5, 1.0), TILTED)
    floor = plane("the floor", (1.0, 2.0, 0.0), (0.0, 0.0, 1.0))
    seen = view.obstacle(floor)
    assert view.position + view.rotation @ seen.position == pytest.approx(floor.position)
    assert view.rotation @ seen.rotation == pytest.approx(floor.rotation)
    assert np.array_equal(seen.half, floor.half)
