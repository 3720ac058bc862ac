"""Goal axes of a whole bridge over real TCP: where the goals begin, what moves them, and what never does."""

import asyncio
import itertools
import secrets
import time
from collections.abc import Mapping, Sequence

import msgspec
import pytest

from lockstep.protocol.actions import Act, ActionUpdate, ParameterValue
from lockstep.protocol.description import Action, RobotDescription
from lockstep.protocol.messages import Feedback, Refusal, Rest, Stop
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.errors import RobotFailed
from lockstep.robot_bridge.robots.actions import ActionRun, ActionStep
from lockstep.robot_bridge.robots.base import Measurement, Robot
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import PATIENCE, Operator, operator, raw_link, running_bridge
from tests.robot_bridge.control.goals.goal_helpers import ARM_AXES, HangingArm

NAMES = [axis.name for axis in ARM_AXES]
HOLD = 0.3


def goals(**wanted: float) -> list[float | None]:
    """A command with these goals, and all else at rest."""
    values: list[float | None] = [0.0, *[None] * 5]
    for name, goal in wanted.items():
        values[NAMES.index(name)] = goal
    return values


def applied_goal(feedback: Feedback, name: str) -> float:
    goal = feedback.goals[NAMES.index(name)]
    assert goal is not None
    return goal


async def drive_to(driver: Operator, name: str, goal: float) -> Feedback:
    while applied_goal(driver.feedback, name) != goal:
        await driver.drive(goals(**{name: goal}))
    return driver.feedback


async def test_the_goals_begin_where_the_robot_holds_its_axes_and_the_first_engagement_moves_nothing() -> None:
    robot = HangingArm(sag=0.1)
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        assert driver.feedback.goals == [None, *robot.applied[0][1:]]
        assert driver.feedback.goals[1:3] == [0.2, 0.4]
        await driver.drive(goals(shoulder=applied_goal(driver.feedback, "shoulder"), turn=0.0))
        await driver.drive(goals())
    assert all(values == robot.applied[0] for values in robot.applied)


async def test_without_goals_of_its_own_it_begins_where_it_is_measured() -> None:
    class Measured(HangingArm):
        def goals(self) -> Sequence[float]:
            return Robot.goals(self)

    robot = Measured(sag=0.1)
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        assert driver.feedback.goals[1:3] == pytest.approx([0.1, 0.3])


async def test_a_reset_does_not_move_an_arm_that_was_held_under_a_load() -> None:
    robot = HangingArm(sag=0.1)
    async with running_bridge(robot) as bridge, operator(bridge) as driver, raw_link(bridge, "events") as watcher:
        await drive_to(driver, "shoulder", 0.5)
        watcher.send(Stop(by="guard"))
        await robot.until(lambda: "stop" in robot.calls, "the robot's own stop")
        await driver.heard(lambda feedback: feedback.stop.stopped)
        first = len(robot.applied)
        await driver.reset()
        await driver.arm()
    assert {values[1] for values in robot.applied[first:]} == {0.5}


async def test_a_goal_is_driven_and_null_for_a_rate_axis_is_refused() -> None:
    robot = HangingArm()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        await drive_to(driver, "shoulder", 0.5)
        assert driver.feedback.axes[1] == 0.5
        assert driver.feedback.goals == [None, 0.5, 0.4, 0.0, pytest.approx(0.9), pytest.approx(0.1)]
        refused = await driver.refused(driver.command([None, *goals()[1:]]))
        assert refused.reason == "not_a_number"
        await driver.drive(goals())


async def test_a_jump_and_a_conflict_execute_nothing() -> None:
    robot = HangingArm()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        event = driver.feedback.event
        jump = await driver.refused(driver.command(goals(shoulder=0.8, elbow=0.41)))
        assert (jump.reason, jump.current) == ("jump", event)
        conflict = await driver.refused(driver.command(goals(shoulder=0.2, x=0.6)))
        assert conflict.reason == "conflict"
        assert driver.feedback.event == event
        await drive_to(driver, "elbow", 0.41)
    assert bridge.counters.refusals == {"jump": 1, "conflict": 1}


async def test_a_lost_link_brakes_the_goal_and_the_next_operator_goes_on_from_there() -> None:
    robot = HangingArm(sag=0.1)
    async with running_bridge(robot) as bridge:
        async with operator(bridge) as driver:
            await driver.drive_until(lambda: robot.pursued[1] > 0.15, goals(shoulder=0.5))
        async with operator(bridge) as driver:
            await driver.heard(lambda feedback: feedback.at_rest)
            stood = applied_goal(driver.feedback, "shoulder")
            assert 0.15 < stood < 0.5
            for _ in range(20):
                await driver.drive(goals(shoulder=stood))
                driver.link.send(Rest(event=driver.feedback.event))
                await driver.drive(goals())
            assert applied_goal(driver.feedback, "shoulder") == stood


async def test_a_stop_brakes_first_and_after_its_reset_the_goal_is_where_the_arm_has_fallen_to() -> None:
    robot = HangingArm(falls=0.4)
    async with running_bridge(robot) as bridge, operator(bridge) as driver, raw_link(bridge, "events") as watcher:
        await driver.drive_until(lambda: robot.pursued[1] > 0.25, goals(shoulder=0.6))
        watcher.send(Stop(by="guard"))
        await robot.until(lambda: "stop" in robot.calls, "the robot's own stop")
        steps = [after[1] - before[1] for before, after in itertools.pairwise(robot.applied)]
        assert max(abs(one - other) for one, other in itertools.pairwise(steps)) < 16 * 0.004**2
        await driver.heard(lambda feedback: feedback.stop.stopped)
        before, fallen = len(robot.applied), robot.pursued[1] - 0.4
        await driver.reset()
        await driver.heard(lambda feedback: applied_goal(feedback, "shoulder") == pytest.approx(fallen))
        await driver.arm()
        assert robot.applied[before][1] != pytest.approx(fallen)
        assert robot.applied[-1][1] == pytest.approx(fallen)


async def test_a_robot_whose_axes_are_not_measured_gets_nothing_applied_until_they_are() -> None:
    class Blind(HangingArm):
        asked = 0

        def measured_axes(self) -> Sequence[float]:
            self.asked += 1
            self._ticked.set()
            return super().measured_axes()

    robot = Blind()
    robot.known = False
    async with running_bridge(robot) as bridge, operator(bridge, armed=False) as driver:
        await robot.until(lambda: robot.asked > 200, "many ticks")
        assert bridge.counters.issued < 20
        assert driver.feedback.goals == [None] * 6
        assert driver.feedback.unknown == NAMES
        assert driver.feedback.neutral_needed
        await driver.drive(goals())
        assert (await driver.refused(driver.command(goals(shoulder=0.2)))).reason in ("jump", "not_neutral")
        assert robot.applied == []
        robot.known = True
        await driver.heard(lambda feedback: feedback.goals[1] is not None)
        await driver.heard(lambda feedback: feedback.neutral_needed)
        await driver.arm()
        await driver.drive(goals(shoulder=0.21))
    assert robot.applied[0] == [0.0, 0.2, 0.4, 0.0, pytest.approx(0.6), pytest.approx(-0.2)]


async def test_an_adapter_that_raises_while_it_is_measured_for_a_command_ends_the_bridge_and_not_the_link() -> None:
    class Broken(HangingArm):
        asked = 0

        def measured_axes(self) -> Sequence[float]:
            self.asked += 1
            if self.asked > 1:
                raise OSError("no answer")
            return super().measured_axes()

        def measure(self) -> Measurement:
            axes = list(HangingArm.measured_axes(self))
            return Measurement(axes=axes, joints=[], wrench=[], ranges=[], at_rest=True, faults=[])

    robot = Broken()
    async with running_bridge(robot) as bridge:
        async with operator(bridge) as driver:
            driver.link.send(driver.command(goals(shoulder=0.3)))
            assert (await driver.next(Refusal)).reason == "jump"
        with pytest.raises(RobotFailed, match="OSError: no answer"):
            await bridge.wait()
    assert robot.applied[-1][1] == 0.2


async def test_commands_that_are_refused_for_a_jump_measure_the_robot_once_a_tick_at_most() -> None:
    class Counting(HangingArm):
        asked = 0
        most = 0  # between two ticks

        def measured_axes(self) -> Sequence[float]:
            self.asked += 1
            self.most = max(self.most, self.asked)
            return super().measured_axes()

        def measure(self) -> Measurement:
            axes = list(HangingArm.measured_axes(self))
            return Measurement(axes=axes, joints=[], wrench=[], ranges=[], at_rest=True, faults=[])

        def tick(self) -> None:
            self.asked = 0

    robot = Counting()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        jump = driver.command(goals(shoulder=1.9))
        for _ in range(40):  # fewer than are read at once
            driver.link.send(jump)
        for _ in range(40):
            assert (await driver.next(Refusal)).reason == "jump"
        assert robot.most == 1
        await drive_to(driver, "shoulder", 0.3)


class Folding(ActionRun):
    """Folds the arm by goals far beyond its reach."""

    def __init__(self, robot: "FoldingArm") -> None:
        self._robot = robot

    def step(self) -> ActionStep:
        done = self._robot.pursued[1:3] == [1.5, -1.5]
        return ActionStep(0.5, values=[0.0, 1.5, -1.5, None, None, None], done=done)

    def cancel(self) -> None:
        pass


class FoldingArm(HangingArm):
    def describe(self) -> RobotDescription:
        return msgspec.structs.replace(super().describe(), actions=(Action(name="fold", label="Fold"),))

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        return Folding(self)


async def test_an_action_drives_goals_beyond_reach_at_the_axes_own_speed_and_stops_without_renewal() -> None:
    robot = FoldingArm()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        ended = await _folded(driver, renews=False)
        assert (ended.state, ended.reason) == ("cancelled", "not_renewed")
        await driver.drive(goals())
        assert 0.2 < robot.pursued[1] < 1.5
        while (ended := await _folded(driver, renews=True)).state != "done":
            assert ended.reason == "not_renewed", ended  # a busy machine held the messages up
    assert robot.pursued[1:3] == [1.5, -1.5]
    steps = [abs(after[1] - before[1]) for before, after in itertools.pairwise(robot.applied)]
    assert max(steps) <= 1.5 * robot.tick_seconds + 1e-9


async def _folded(driver: Operator, *, renews: bool) -> ActionUpdate:
    """Fold, and return how it ended; again if a busy machine held the bridge up."""
    while True:
        await driver.arm()
        ended = await _fold(driver, renews)
        if ended.reason not in ("interrupted", "not_neutral"):
            return ended


async def _fold(driver: Operator, renews: bool) -> ActionUpdate:
    """`renews`: send neutral commands that renew the action."""
    id = secrets.token_hex(16)
    driver.link.send(Act(id=id, name="fold", nonce=driver.feedback.nonce))
    if renews:
        driver.link.send(msgspec.structs.replace(driver.command(goals()), action=id))
    async with asyncio.timeout(PATIENCE):
        async for message in driver.link:
            if isinstance(message, Feedback):
                driver.feedback = message
                if renews:
                    driver.link.send(msgspec.structs.replace(driver.command(goals()), action=id))
            elif isinstance(message, ActionUpdate) and message.id == id and message.state != "running":
                return message
    raise AssertionError("the link was closed")


async def test_a_command_that_is_not_repeated_stands_still_after_hold() -> None:
    robot = HangingArm()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        await driver.drive(goals(turn=1.0))
        await driver.heard(lambda feedback: feedback.at_rest)
        stood = applied_goal(driver.feedback, "turn")
        assert 0 < stood < 1.5 * HOLD
        await driver.next(Feedback)
        assert applied_goal(driver.feedback, "turn") == stood


async def test_after_a_suspend_the_goals_are_where_they_were_before_it() -> None:
    class Patient(HangingArm):
        rests_from_thread = True
        rested = 0

        def describe(self) -> RobotDescription:
            return msgspec.structs.replace(super().describe(), hold=5.0, watchdog=2.0)

        def rest_from_thread(self) -> None:
            self.rested += 1

    suspended = 0.0
    robot = Patient()
    bridge = Bridge(robot, BridgeSettings(port=0), lambda: time.monotonic() + suspended)
    async with bridge, operator(bridge) as driver:
        for _ in range(5):
            await driver.drive(goals(turn=0.9))
        before = robot.applied[-1]
        suspended = 2.5
        await driver.heard(lambda feedback: feedback.neutral_needed)
        assert robot.applied[-1] == before
        assert robot.rested
