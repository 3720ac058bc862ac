"""The drive between the bridge's shaping of goals and the servos, with an arm of a few bodies in place of the model."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import msgspec
import numpy as np
import pytest
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from lockstep.protocol.description import Pose
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.kinematics.pose_solver import PoseSolver
from lockstep.robot_bridge.kinematics.rotations import from_rotation_vector, rotation_vector
from lockstep.robot_bridge.robots.so101.arm_drive import AHEAD, SETTLES, ArmDrive
from lockstep.robot_bridge.robots.so101.controls import JOINT_AXES, POSITION_AXES, RATES, ROTATION_AXES
from tests.robot_bridge.kinematics.arms import BOUNDS, desk_arm

TICK, EVENT, HOLD = 0.004, 0.04, 0.3  # s
SLOW: Final = 0.2  # of the joints' rates: an arm that the tool's goal leaves far behind
AXES = (*JOINT_AXES[:5], *POSITION_AXES, *ROTATION_AXES)
POSE = Pose(
    name="tool",
    label="Tool",
    body="hand",
    position=("tool.x", "tool.y", "tool.z"),
    rotation=("tool.rx", "tool.ry", "tool.rz"),
    instead_of=tuple(axis.name for axis in JOINT_AXES[:5]),
    settling=SETTLES,
)
START = (0.1, -0.3, 0.6, 0.7, 0.2)
SLACK = 1e-9


class Spell(NamedTuple):
    """One goal for a while."""

    drives: str  # "joints", "tool", "nothing"
    ways: tuple[float, ...]  # rad or m from where the axes are
    events: int


class World:
    """Arm and bridge in simulated time; the arm is where its goals are."""

    def __init__(self, pace: float = 1.0) -> None:
        """`pace`: of the joints, as a share of their rates."""
        rates = tuple(pace * rate for rate in RATES[:5])
        bounds = BOUNDS._replace(rates=tuple(pace * rate for rate in BOUNDS.rates))
        joints = [msgspec.structs.replace(axis, slew=pace * axis.slew) for axis in JOINT_AXES[:5]]
        self.drive = ArmDrive(desk_arm(), PoseSolver(desk_arm(), bounds), rates, START)
        self.shaper = AxisShaper([*joints, *AXES[5:]], hold=HOLD, poses=(POSE,), pursued=self.drive.pursued)
        self.shaper.begin(self.drive.pursued(), self.drive.pursued())
        self.now = 0.0
        self.executed_at = -math.inf
        self.values: list[float] = []
        self.way: list[tuple[float, ...]] = [START]

    def play(self, spell: Spell) -> None:
        here = self.drive.pursued()
        numbers = {"joints": range(5), "tool": range(5, 11), "nothing": range(0)}[spell.drives]
        goals = [here[number] + spell.ways[number] if number in numbers else None for number in range(len(AXES))]
        for _ in range(spell.events):
            if spell.drives != "nothing":
                self.command(goals)
            self.wait(EVENT)

    def command(self, goals: Sequence[float | None], speed: float = 1.0) -> None:
        self.shaper.drive(goals, self.now, speed)
        self.executed_at = self.now

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            self.tick(TICK)

    def tick(self, since: float) -> None:
        """`since`: s since the tick before, in which nothing moved."""
        self.now += since - TICK
        before = self.drive.goals
        self.values = self.shaper.step(self.now, TICK)
        rates = self.drive.drive(self.values, TICK, since, pursues=bool(self.shaper.pursued_poses))
        assert self.drive.goals == pytest.approx(np.array(before) + np.array(rates) * TICK, abs=SLACK)
        self.way.append(self.drive.goals)
        self.now += TICK


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


lulls = st.lists(st.just(TICK) | st.floats(TICK / 4, 4 * TICK) | st.floats(0.0, 0.25), min_size=1, max_size=80)


class Life(RuleBasedStateMachine):
    """Commands, rests and stops at any time; ticks early, late and held up; an arm that lags."""

    @initialize(pace=st.sampled_from([1.0, SLOW]))
    def begin(self, pace: float) -> None:
        self.world = World(pace)
        self.goals: list[float | None] = [None] * len(AXES)
        self.rested: tuple[float, ...] | None = None  # the joints' goals when the bridge said that the arm rests

    @rule(drives=st.sampled_from(("joints", "tool")), ways=st.tuples(*[st.floats(-0.1, 0.1)] * 8, *[joint_ways] * 3))
    def command_a_new_goal(self, drives: str, ways: tuple[float, ...]) -> None:
        here = self.world.shaper.goals
        numbers = range(5) if drives == "joints" else range(5, 11)
        self.goals = [(here[number] or 0.0) + ways[number] if number in numbers else None for number in range(11)]
        self.command_the_same_goal()

    @rule(speed=st.sampled_from([1.0, 0.3, 0.0]))
    def command_the_same_goal(self, speed: float = 1.0) -> None:
        self.world.command(self.goals, speed)
        self.rested = None

    @rule(times=st.integers(1, 12), gap=st.floats(0.02, 0.5))
    def repeat_it_for_a_while(self, times: int, gap: float) -> None:
        for _ in range(times):
            self.command_the_same_goal()
            self.ticks_pass([TICK] * round(gap / TICK))

    @rule()
    def let_go(self) -> None:
        self.world.command([None] * len(AXES))

    @rule()
    def rest(self) -> None:
        self.world.shaper.rest()

    @rule(lulls=lulls)
    def ticks_pass(self, lulls: list[float]) -> None:
        world = self.world
        for since in lulls:
            before = world.drive.goals
            world.tick(since)
            began = world.now - TICK
            assert began < world.executed_at + HOLD or world.drive.goals == before, "a joint moves after hold"
            if self.rested is not None:  # since the tick before
                assert world.drive.goals == self.rested, "it moves without a new command"
                assert world.shaper.goals == pytest.approx(world.drive.pursued(), abs=1e-6), "its goals are elsewhere"
            self.rested = world.drive.goals if world.shaper.at_rest else None

    @rule()
    def it_comes_to_rest_because_the_bridge_ends(self) -> None:
        world, still = self.world, 0
        for _ in range(round(HOLD / TICK) + 2):
            before = world.drive.goals
            world.drive.drive(world.shaper.brake(TICK), TICK, TICK, pursues=bool(world.shaper.pursued_poses))
            world.now += TICK
            still = still + 1 if world.drive.goals == before else 0
        assert world.shaper.at_rest
        assert still
        self.rested = world.drive.goals


Life.TestCase.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
TestLife = pytest.mark.slow(Life.TestCase)


@pytest.mark.slow
@settings(max_examples=15, deadline=None, phases=(Phase.explicit, Phase.reuse, Phase.generate))
@given(st.tuples(*[st.floats(-0.2, 0.2)] * 5), st.sampled_from([EVENT, 0.15, 0.2, 0.29, 0.45]))
def test_a_goal_within_reach_that_is_commanded_on_and_on_is_reached_however_slow_the_arm_and_the_network(
    ways: tuple[float, ...], gap: float
) -> None:
    world = World(SLOW)
    there = desk_arm().at([place + way for place, way in zip(START, ways, strict=True)])
    goal = [*there.position.tolist(), *rotation_vector(there.rotation).tolist()]
    assume(all(axis.minimum < value < axis.maximum for axis, value in zip(AXES[5:], goal, strict=True)))
    for _ in range(round(6.0 / min(gap, 0.15))):  # a command drives for no longer
        world.command([None] * 5 + goal)
        world.wait(gap)
    assert world.shaper.goals[5:] == pytest.approx(goal, abs=1e-9)
    assert world.drive.pursued()[5:] == pytest.approx(goal, abs=1e-3)


def test_a_tool_that_is_driven_at_no_speed_comes_to_rest_and_goes_on_at_another() -> None:
    world = World(SLOW)
    goal: list[float | None] = [*([None] * 5), *world.drive.pursued()[5:]]
    assert goal[5] is not None
    goal[5] -= 0.08
    for _ in range(10):
        world.command(goal)
        world.wait(EVENT)
    for _ in range(10):
        world.command(goal, speed=0.0)
        world.wait(EVENT)
    stood = world.drive.goals
    world.command(goal, speed=0.0)
    world.wait(EVENT)
    assert world.drive.goals == stood
    assert world.drive.pursued()[5] > goal[5] + 0.005
    for _ in range(100):
        world.command(goal)
        world.wait(EVENT)
    assert world.drive.pursued()[5] == pytest.approx(goal[5], abs=1e-4)


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
