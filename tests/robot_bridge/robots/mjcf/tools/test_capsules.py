import itertools
from functools import partial
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from lockstep.robot_bridge.kinematics.capsules import capsule_around, separate_pairs
from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.clearance import Capsule
from lockstep.robot_bridge.robots.mjcf.bodies import bodies_of
from lockstep.robot_bridge.robots.mjcf.joints import joints_of
from lockstep.robot_bridge.robots.mjcf.tools.capsules import capsules_of, may_touch

SHAPES = {
    "sphere": '<geom type="sphere" size="0.1"/>',
    "capsule": '<geom type="capsule" size="0.03 0.1" euler="0.3 0.5 0.1" pos="0.1 0 0.2"/>',
    "cylinder": '<geom type="cylinder" size="0.05 0.1" pos="0 0.1 0" euler="1 0 0"/>',
    "box": '<geom type="box" size="0.05 0.1 0.02" euler="0 0 0.4"/>',
    "ellipsoid": '<geom type="ellipsoid" size="0.05 0.1 0.02" euler="0 0.4 0"/>',
    "mesh": '<geom type="mesh" mesh="wedge" pos="0 0 0.1"/>',
}
WEDGE = '<asset><mesh name="wedge" vertex="0 0 0  0.2 0 0  0 0.1 0  0 0 0.1  0.2 0 0.1"/></asset>'


def compiled(bodies: str, more: str = "") -> tuple[Any, Any]:
    model: Any = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/>{WEDGE}<worldbody>{bodies}</worldbody>{more}</mujoco>'
    )
    data: Any = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def holds(capsule: Capsule, point: Any, radius: float = 0.0) -> bool:
    start, end = np.array(capsule.start), np.array(capsule.end)
    way = end - start
    share = min(max(float((point - start) @ way) / max(float(way @ way), 1e-12), 0.0), 1.0)
    return bool(np.linalg.norm(point - start - share * way) + radius <= capsule.radius + 1e-6)


@given(
    arrays.arrays(np.float64, st.tuples(st.integers(1, 12), st.just(3)), elements=st.floats(-1, 1)), st.floats(0, 0.3)
)
def test_a_capsule_holds_all_spheres(points: Any, radius: float) -> None:
    capsule = capsule_around(points, np.full(len(points), radius))
    assert all(holds(capsule, point, radius) for point in points)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_capsule_of_a_body_holds_its_shape(shape: str) -> None:
    model, data = compiled(f'<body name="a"><joint/>{SHAPES[shape]}</body>')
    capsule = capsules_of(model, range(2))["a"]
    hit = np.zeros(1, dtype=np.int32)
    far = 2.0
    for direction in itertools.product((-1.0, 0.0, 1.0), repeat=3):
        if any(direction):
            ray = np.array(direction) / np.linalg.norm(direction)
            outside = data.geom_xpos[0] + far * ray
            distance = mujoco.mj_ray(model, data, outside, -ray, None, 1, -1, hit, None)
            assert holds(capsule, outside - distance * ray)


LINK = '<body name="{0}" pos="0.3 0 0"><joint axis="0 0 1"/><geom type="sphere" size="{1}"/>'


def arm(*sizes: float) -> str:
    """Links in a row, each with a ball at its joint."""
    return "".join(LINK.format("abcdef"[number], size) for number, size in enumerate(sizes)) + "</body>" * len(sizes)


def pairs(bodies: str, count: int, more: str = "") -> set[tuple[str, str]]:
    model, _ = compiled(bodies, more)
    chain = Chain(bodies_of(model, joints_of(model)), "abcdef"[count - 1])
    return set(separate_pairs(chain, capsules_of(model, range(count + 1)), [0.0] * count, partial(may_touch, model)))


def test_parts_with_more_than_one_joint_between_them_must_not_touch() -> None:
    assert pairs(arm(0.05, 0.05, 0.05, 0.05), 4) == {("a", "c"), ("a", "d"), ("b", "d")}


def test_parts_that_the_model_lets_pass_through_each_other_are_no_pair() -> None:
    exclude = '<contact><exclude body1="a" body2="c"/></contact>'
    assert pairs(arm(0.05, 0.05, 0.05, 0.05), 4, exclude) == {("a", "d"), ("b", "d")}
    drawn = arm(0.05, 0.05, 0.05, 0.05).replace(
        '<geom type="sphere"', '<geom contype="0" conaffinity="0" type="sphere"'
    )
    assert pairs(drawn, 4) == set()


def test_parts_whose_capsules_meet_where_the_model_begins_are_no_pair() -> None:
    assert pairs(arm(0.25, 0.05, 0.40, 0.05), 4) == {("a", "d"), ("b", "d")}
