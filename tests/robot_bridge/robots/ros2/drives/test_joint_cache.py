"""What is known of each joint."""

import math
from dataclasses import dataclass, field

import pytest

from lockstep.robot_bridge.robots.ros2.drives.joint_cache import BadJointState, JointCache

NAMES = ("shoulder", "elbow")


@dataclass
class State:
    name: list[str]
    position: list[float]
    velocity: list[float] = field(default_factory=list)


def test_joints_are_found_by_name_whatever_their_order() -> None:
    book = JointCache(NAMES)
    book.take(State(["elbow", "gripper", "shoulder"], [2.0, 9.0, 1.0], [0.2, 0.9, 0.1]), 1, 10.0)
    assert [(joint.position, joint.velocity) for joint in book.fresh(0.5, 10.0)] == [(1.0, 0.1), (2.0, 0.2)]


def test_joints_may_come_in_separate_messages_with_the_same_stamp() -> None:
    book = JointCache(NAMES)
    book.take(State(["elbow"], [2.0], [0.0]), 7, 10.0)
    assert book.missing(0.5, 10.0) == ["shoulder"]
    book.take(State(["shoulder"], [1.0], [0.0]), 7, 10.0)
    assert book.missing(0.5, 10.0) == []


def test_a_joint_that_is_not_heard_of_any_more_is_unknown() -> None:
    book = JointCache(NAMES)
    book.take(State(["shoulder", "elbow"], [1.0, 2.0], [0.0, 0.0]), 1, 10.0)
    book.take(State(["shoulder"], [1.5], [0.0]), 2, 11.0)
    assert book.missing(0.5, 11.0) == ["elbow"]
    shoulder, elbow = book.fresh(0.5, 11.0)
    assert shoulder.position == 1.5
    assert math.isnan(elbow.position)


def test_the_same_stamp_again_is_nothing_new() -> None:
    book = JointCache(NAMES)
    for now in (10.0, 10.4, 10.8):
        book.take(State(["shoulder", "elbow"], [1.0, 2.0], [0.0, 0.0]), 5, now)
    assert book.missing(0.5, 10.8) == ["shoulder", "elbow"]


def test_a_velocity_that_is_not_given_is_that_of_the_way_since_the_last_message() -> None:
    book = JointCache(["elbow"])
    book.take(State(["elbow"], [1.0]), 1_000_000_000, 10.0)
    assert math.isnan(book.fresh(0.5, 10.0)[0].velocity)
    book.take(State(["elbow"], [1.1]), 1_100_000_000, 10.3)
    assert book.fresh(0.5, 10.3)[0].velocity == pytest.approx(1.0)


@pytest.mark.parametrize(
    "state",
    [
        State(["shoulder", "elbow"], [1.0]),
        State(["shoulder"], [math.nan]),
        State(["shoulder"], [math.inf]),
        State([], [1.0]),
    ],
)
def test_a_message_that_contradicts_itself_changes_nothing(state: State) -> None:
    book = JointCache(NAMES)
    with pytest.raises(BadJointState):
        book.take(state, 1, 10.0)
    assert book.missing(0.5, 10.0) == ["shoulder", "elbow"]
