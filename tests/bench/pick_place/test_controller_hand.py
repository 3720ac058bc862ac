"""The hand in the headset goes the way that the tool's goal still has to go."""

from typing import Final

import numpy as np
import pytest

from lockstep.bench.pick_place.controller_hand import STEP, TURN, ControllerHand
from lockstep.robot_bridge.kinematics.rotations import from_quaternion, rotation_vector

PLACE: Final = {"tool.x": 0.2, "tool.y": 0.0, "tool.z": 0.1, "tool.rx": 0.0, "tool.ry": 1.57, "tool.rz": 0.0}
FAR: Final = 0.5


# In the headset x is to the right, y up and -z ahead.
@pytest.mark.parametrize(
    ("axis", "way"), [("tool.x", (0, 0, -STEP)), ("tool.y", (-STEP, 0, 0)), ("tool.z", (0, STEP, 0))]
)
def test_the_hand_moves_as_the_tool_is_to_and_no_faster_than_a_calm_one(
    axis: str, way: tuple[float, float, float]
) -> None:
    hand = ControllerHand()
    before = hand.move(PLACE, PLACE, {}, 1.0).position
    after = hand.move(PLACE | {axis: PLACE[axis] + FAR}, PLACE, {}, 1.0).position
    assert np.subtract(after, before) == pytest.approx(np.array(way))


def test_the_hand_turns_to_the_left_where_the_tool_is_to_turn_to_the_left() -> None:
    level = PLACE | {"tool.ry": 0.0}
    x, y, z, w = ControllerHand().move(level | {"tool.rz": FAR}, level, {}, 1.0).turned
    assert rotation_vector(from_quaternion([w, x, y, z])) == pytest.approx(np.array((0, TURN, 0)))


def test_the_hand_holds_still_where_the_goal_is_right_and_where_nothing_is_led() -> None:
    hand = ControllerHand()
    first = hand.move(PLACE, PLACE, {}, 1.0)
    wanted = PLACE | {"tool.x": 0.4}
    assert hand.move(wanted, dict.fromkeys(PLACE), {}, 1.0).position == first.position
    assert hand.move({"gripper": 0.7}, PLACE, {}, 1.0).position == first.position


def test_the_right_trigger_opens_the_gripper_and_the_left_one_closes_it() -> None:
    hand = ControllerHand()
    left, right = hand.move({"gripper": 0.75}, {}, {"gripper": 0.3}, 1.0).triggers
    assert (left, right > 0) == (0, True)
    left, right = hand.move({"gripper": -0.1}, {}, {"gripper": 0.3}, 1.0).triggers
    assert (left > 0, right) == (True, 0)
    assert hand.move({"gripper": 0.75}, {}, {"gripper": 0.75}, 1.0).triggers == (0, 0)
