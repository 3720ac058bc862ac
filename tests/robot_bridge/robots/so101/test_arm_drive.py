"""The drive between the bridge's shaping of goals and the servos, with an arm of a few bodies in place of the model."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.robot_bridge.kinematics.pose_solver import PoseSolver
from lockstep.robot_bridge.kinematics.rotations import from_rotation_vector, rotation_vector
from lockstep.robot_bridge.robots.so101.arm_drive import AHEAD, SETTLES, ArmDrive
from lockstep.robot_bridge.robots.so101.controls import JOINT_AXES, RATES
from tests.robot_bridge.kinematics.arms import BOUNDS, desk_arm
from tests.robot_bridge.robots.so101.arm_world import HOLD, SLACK, START, TICK, Spell, World

joint_ways = st.floats(-0.6, 0.6)
spells = st.builds(
    Spell,
    st.sampled_from(("joints", "tool", "nothing")),
    st.tuples(*[joint_ways] * 5, *[st.floats(-0.1, 0.1)] * 3, *[joint_ways] * 3),
    st.integers(1, 12),
)


@pytest.mark.slow
@settings(max_examples=30)
@given(st.lists(spells, min_size=1, max_size=6))
def test_whatever_is_driven_in_turn_no_joint_goal_jumps_or_leaves_its_range_and_all_rest_within_hold(
    played: Sequence[Spell],
) -> None:
    world = World()
    for spell in played:
        world.play(spell)
    world.wait(HOLD)  # since the end of an event, which is after its beginning
    rest = world.drive.goals
    world.wait(0.2)
    assert world.drive.goals == rest
    steps = np.abs(np.diff(np.array(world.way), axis=0))
    assert (steps <= np.array(RATES[:5]) * TICK + SLACK).all()
    for number, values in enumerate(zip(*world.way, strict=True)):
        assert JOINT_AXES[number].minimum - SLACK <= min(values)
        assert max(values) <= JOINT_AXES[number].maximum + SLACK


def test_ticks_that_are_held_up_make_settling_no_longer() -> None:
    world = World()
    world.play(Spell("tool", (0.1,) * 11, 12))
    world.drive.drive(world.values, TICK)
    moved = 0
    while world.drive.drive(world.values, TICK, since=10 * TICK).any():
        moved += 1
    assert 1 <= moved <= SETTLES / (10 * TICK)


def test_an_arm_that_is_blocked_gets_goals_no_further_ahead_than_a_joints_reach() -> None:
    drive = ArmDrive(desk_arm(), PoseSolver(desk_arm(), BOUNDS), RATES[:5], START)
    goal = drive.pursued()[5:]
    for _ in range(1000):
        goal[3] += 1.2 * TICK
        rates = drive.drive([*START, *goal], TICK, measured=START)
        assert np.abs(np.array(drive.goals) - START).max() <= AHEAD + SLACK
    assert np.abs(rates).max() < 1e-6
    assert np.abs(np.array(drive.goals) - START).max() == pytest.approx(AHEAD)


def test_a_tool_whose_goal_is_turned_past_it_does_not_swing_round_the_other_way() -> None:
    """The roll is near the end of its range, and its goal is turned on."""
    drive = ArmDrive(desk_arm(), PoseSolver(desk_arm(), BOUNDS), RATES[:5], (0.0, -0.3, 0.6, -0.3, 2.6))
    x, y, z = drive.pursued()[5:8]
    rolled = 2.6
    while rolled < 2.6 + 5.0:
        rolled += 1.2 * TICK
        drive.drive([*START, x, y, z, *rotation_vector(from_rotation_vector((rolled, 0.0, 0.0)))], TICK)
        assert drive.goals[4] > 2.55
    assert any("turned too far away" in fault for fault in drive.faults)
    while rolled > 2.0:
        rolled -= 1.2 * TICK
        drive.drive([*START, x, y, z, *rotation_vector(from_rotation_vector((rolled, 0.0, 0.0)))], TICK)
    assert drive.goals[4] == pytest.approx(2.0, abs=0.1)
    assert not any("turned too far away" in fault for fault in drive.faults)


def test_the_first_values_after_a_restart_move_nothing() -> None:
    world = World()
    world.play(Spell("joints", (0.3,) * 11, 10))
    world.drive.restart()
    held = world.drive.goals
    for _ in range(10):
        assert not world.drive.drive([0.0] * 11, TICK).any()
    assert world.drive.goals == held


def test_a_value_that_is_no_number_moves_nothing() -> None:
    world = World()
    world.wait(0.04)
    assert not world.drive.drive([math.nan] * 11, TICK).any()


def test_a_held_posture_is_kept_until_the_values_change() -> None:
    world = World()
    world.play(Spell("tool", (0.05,) * 11, 4))
    world.drive.hold(START)
    world.wait(HOLD)
    settled = world.drive.goals
    world.wait(0.5)
    assert world.drive.goals == settled
    world.play(Spell("joints", (0.2,) * 11, 40))
    assert world.drive.goals[0] == pytest.approx(settled[0] + 0.2, abs=1e-6)


@pytest.mark.parametrize("number", [0, 5])
def test_what_a_tick_has_changed_that_was_held_up_moves_nothing_after_the_hold(number: int) -> None:
    """The watchdog has brought the arm to rest between `apply` and `tick`, behind the tool's goal as it is then."""
    world = World()
    world.play(Spell("tool", (0.1,) * 11, 12))
    world.drive.hold()
    held, applied = world.drive.goals, list(world.values)
    applied[number] += 0.001
    assert not world.drive.drive(applied, TICK, pursues=True).any(), "of the tick that was held up"
    for _ in range(100):
        assert not world.drive.drive(applied, TICK).any()
    assert world.drive.goals == held
    applied[0] += 0.01
    assert world.drive.drive(applied, TICK).any(), "a new command drives it"
