"""Sticks, cross and triggers of a scripted person follow what the page shows."""

from collections.abc import Sequence
from typing import Final

import pytest

from lockstep.bench.pick_place.pad_hand import FAR_TURN, HARDER, PATIENCE, SLOW_SHARE, PadHand, deflection, gain_for
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.robots.so101.controls import AXES, LAYERS

ROBOT: Final = RobotDescription(name="so101", label="SO-101", axes=AXES, layers=LAYERS)
NAMES: Final = [axis.name for axis in AXES]
DOWN: Final = {"tool.rx": 0.0, "tool.ry": 1.57, "tool.rz": 0.0}
AT: Final = {"tool.x": 0.2, "tool.y": 0.0, "tool.z": 0.1} | DOWN


def seen(places: dict[str, float], event: int = 1) -> Feedback:
    """What the page shows when tool and gripper are there, with goals at the same place."""
    values: Sequence[float] = [places.get(name, 0.0) for name in NAMES]
    return Feedback(event=event, issue=1, time=float(event), axes=[*values], goals=[*values])


def shaped(stick: float) -> float:
    """The page's shaping (docs/gamepads.md): no play, a third of it cubic."""
    travel = max(0.0, abs(stick) - 0.12) / 0.88
    return (0.65 * travel + 0.35 * travel**3) * (1 if stick > 0 else -1)


@pytest.mark.parametrize("share", [-1.0, -0.3, 0.02, 0.5, 1.0])
def test_a_stick_goes_where_the_pages_shaping_gives_the_share(share: float) -> None:
    assert shaped(deflection(share)) == pytest.approx(share, abs=1e-4)
    assert deflection(0.0) == 0.0


def test_whoever_sees_late_goes_slowly() -> None:
    assert gain_for(0.0) == gain_for(0.01) > gain_for(0.8) > gain_for(5.0) > 0


def test_each_stick_moves_its_axis_towards_the_goal_and_is_let_go_there() -> None:
    hand = PadHand(ROBOT)
    wanted = AT | {"tool.x": 0.25, "tool.y": -0.05, "tool.z": 0.05}
    move = hand.move(wanted, seen(AT), 1.0)
    assert move.sticks[1] < 0  # up: forward
    assert move.sticks[0] > 0  # right
    assert move.sticks[3] > 0  # down
    assert not move.pressed
    assert not hand.move(wanted, seen(wanted), 1.0).sticks


def test_the_triggers_open_and_close_the_gripper() -> None:
    hand = PadHand(ROBOT)
    assert hand.move({"gripper": 0.75}, seen({"gripper": 0.3}), 1.0).triggers.keys() == {7}
    assert hand.move({"gripper": -0.1}, seen({"gripper": 0.75}), 1.0).triggers.keys() == {6}


def test_the_cross_is_pressed_for_a_wide_turn_and_slowly_for_a_small_one_with_the_sticks_further_out() -> None:
    hand = PadHand(ROBOT)
    wide = hand.move(AT | {"tool.ry": 1.57 + 2 * FAR_TURN}, seen(AT), 1.0)
    assert (wide.pressed, wide.slow) == ({13}, False)
    small = hand.move(AT | {"tool.ry": 1.57 - FAR_TURN / 2, "tool.x": 0.21}, seen(AT), 1.0)
    assert (small.pressed, small.slow) == ({12}, True)
    alone = hand.move(AT | {"tool.x": 0.21}, seen(AT), 1.0)
    assert not alone.slow
    assert shaped(small.sticks[1]) * SLOW_SHARE == pytest.approx(shaped(alone.sticks[1]), abs=1e-3)


def test_a_tool_that_does_not_turn_further_is_turned_as_far_as_the_joints_can() -> None:
    hand, goals = PadHand(ROBOT), AT | {"tool.ry": 1.8}
    for event in range(1, PATIENCE + 2):
        hand.values(goals, seen(AT, event))
        assert hand.applied(goals, seen(AT, event)) == (event > PATIENCE)
        hand.move(goals, seen(AT, event), 1.0)
    assert not hand.move(goals, seen(AT), 1.0).pressed


def test_a_tool_that_does_not_move_is_pushed_harder_until_it_does() -> None:
    hand, goals = PadHand(ROBOT), AT | {"tool.z": 0.11}
    pushed = []
    for event in range(1, 4 * HARDER):
        hand.values(goals, seen(AT, event))
        pushed.append(abs(hand.move(goals, seen(AT, event), 0.5).sticks[3]))
    assert pushed == sorted(pushed)
    assert pushed[-1] > 2 * pushed[0]
    moved = seen(AT | {"tool.z": 0.102}, 4 * HARDER)
    hand.values(goals, moved)
    assert abs(hand.move(goals, moved, 0.5).sticks[3]) < pushed[0]


def test_a_gripper_that_the_block_keeps_open_is_shut_when_its_goal_is() -> None:
    hand, goals = PadHand(ROBOT), {"gripper": -0.1}
    feedback = seen({"gripper": 0.2})
    assert not hand.applied(goals, feedback)
    shut = [-0.1 if name == "gripper" else goal for name, goal in zip(NAMES, feedback.goals, strict=True)]
    assert hand.applied(goals, Feedback(event=1, issue=1, time=1.0, axes=feedback.axes, goals=shut))
