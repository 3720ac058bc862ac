"""A tool's goal that stands still is pursued while commands repeat it, and never after `hold`."""

import pytest
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from lockstep.client.control.goal_move import GoalMove
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.kinematics.rotations import rotation_vector
from tests.robot_bridge.kinematics.arms import desk_arm
from tests.robot_bridge.robots.so101.arm_world import AXES, EVENT, HOLD, SLOW, START, TICK, World

pytestmark = pytest.mark.slow

joint_ways = st.floats(-0.6, 0.6)
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

    @rule(since=st.floats(0.1, 0.6))
    def the_bridge_is_held_up(self, since: float) -> None:
        before = self.world.drive.goals
        self.world.tick(since, held_up=True)
        assert self.world.drive.goals == before
        self.rested = before

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


def test_in_the_tick_in_which_the_arm_counts_as_at_rest_its_goals_are_where_it_has_come_to() -> None:
    """The feedback of that tick is what the next hand engages at."""
    world = World(SLOW)
    goal: list[float | None] = [*([None] * 5), *world.drive.pursued()[5:]]
    assert goal[5] is not None
    goal[5] -= 0.08
    for _ in range(10):
        world.command(goal)
        world.wait(EVENT)
    world.shaper.rest()
    while not world.shaper.at_rest:
        world.tick(TICK)
    assert world.shaper.goals == pytest.approx(world.drive.pursued(), abs=1e-9)


@pytest.mark.parametrize("gap", [EVENT, 0.2, 0.45])
def test_a_client_that_moves_the_tool_gets_there_however_slow_arm_and_network_are(gap: float) -> None:
    world = World(SLOW)
    description = RobotDescription(name="arm", label="Arm", axes=AXES)
    there = desk_arm().at([0.5, -0.5, 0.9, 0.4, -0.2])
    goal = [*there.position.tolist(), *rotation_vector(there.rotation).tolist()]
    move = GoalMove(description, {axis.name: value for axis, value in zip(AXES[5:], goal, strict=True)}, None)

    def feedback() -> Feedback:
        return Feedback(event=2, issue=1, time=world.now, axes=world.drive.pursued(), goals=world.shaper.goals)

    while not move.arrived(feedback(), world.now):  # raises when the tool comes no nearer
        world.command(move.values(feedback()))
        world.wait(gap)
    assert world.drive.pursued()[5:8] == pytest.approx(goal[:3], abs=5e-3)
