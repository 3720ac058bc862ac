"""Poses of frames in each other, from transforms as tf2 sends them."""

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.robots.ros2.mapping.transforms import TransformTree, composed, inverted

POSES = st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi))


def transform(parent: str, child: str, x: float, y: float, yaw: float = 0.0) -> Any:
    turn = SimpleNamespace(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=parent),
        child_frame_id=child,
        transform=SimpleNamespace(translation=SimpleNamespace(x=x, y=y, z=0.3), rotation=turn),
    )


def tree(*transforms: Any, now: float = 0.0, static: bool = False) -> TransformTree:
    made = TransformTree()
    made.take(SimpleNamespace(transforms=list(transforms)), now, static=static)
    return made


def test_a_pose_goes_up_and_down_the_tree() -> None:
    frames = tree(
        transform("map", "odom", 1, 2, math.pi / 2),
        transform("/odom", "/base_link", 3, 0),
        transform("base_link", "laser", 0.2, 0, math.pi),
    )
    assert frames.pose("map", "base_link", 0, 1) == pytest.approx((1, 5, math.pi / 2))
    assert frames.pose("base_link", "laser", 0, 1) == pytest.approx((0.2, 0, math.pi))
    assert frames.pose("laser", "base_link", 0, 1) == pytest.approx((0.2, 0, -math.pi), abs=1e-9)
    assert frames.pose("odom", "odom", 0, 1) == (0, 0, 0)


def test_what_is_old_or_not_connected_is_not_known_and_static_transforms_never_get_old() -> None:
    frames = tree(transform("map", "odom", 1, 2))
    assert frames.pose("map", "odom", 5.0, 5.0) is not None
    assert frames.pose("map", "odom", 5.1, 5.0) is None
    assert frames.pose("map", "arm", 0, 1) is None
    assert tree(transform("map", "odom", 1, 2), static=True).pose("map", "odom", 1e6, 1.0) is not None


def test_a_circle_ends_and_nonsense_is_left_out() -> None:
    frames = tree(transform("a", "b", 1, 0), transform("b", "a", 1, 0), transform("c", "c", 1, 0))
    frames.pose("a", "b", 0, 1)
    assert frames.pose("a", "c", 0, 1) is None
    assert tree(transform("a", "b", math.nan, 0)).pose("a", "b", 0, 1) is None
    broken = transform("a", "b", 0, 0)
    broken.transform.rotation.w = 0.0
    assert tree(broken).pose("a", "b", 0, 1) is None


@pytest.mark.timeout(20)
def test_endless_new_frames_take_no_endless_memory() -> None:
    frames = TransformTree()
    for number in range(5000):
        frames.take(SimpleNamespace(transforms=[transform("map", f"f{number}", 0, 0)]), 0, static=False)
    assert frames.pose("map", "f0", 0, 1) is not None
    assert frames.pose("map", "f4999", 0, 1) is None


@given(POSES, POSES)
def test_a_pose_is_found_again_through_the_inverse(outer: Any, inner: Any) -> None:
    back = composed(inverted(outer), composed(outer, inner))
    assert back[:2] == pytest.approx(inner[:2], abs=1e-6)
    assert math.cos(back[2] - inner[2]) == pytest.approx(1, abs=1e-9)
