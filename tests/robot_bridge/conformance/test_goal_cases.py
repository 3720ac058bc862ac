"""The cases about goal axes pass on the bridge, and each finds the fault that it is about."""

import math
from collections.abc import Sequence

import msgspec
import pytest

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.conformance import CASES, Outcome, Result, Subject, play
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.control.goals.command_values import CommandValues
from lockstep.robot_bridge.control.limits import goal_axis
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.limits.goal_axis import GoalAxis
from lockstep.robot_bridge.robots.base import Robot
from tests.robot_bridge.bridge_helpers import running_bridge
from tests.robot_bridge.conformance.plain_bridge import running_plain_bridge
from tests.robot_bridge.control.goals.goal_helpers import HangingArm

ABOUT_GOALS = [case for case in CASES if case.name.startswith("goal")]


class OnlyArm(HangingArm):
    """Has no base: also the cases about other things move a goal axis."""

    def describe(self) -> RobotDescription:
        found = super().describe()
        return msgspec.structs.replace(found, axes=found.axes[1:])

    def apply(self, values: Sequence[float]) -> None:
        super().apply([0.0, *values])

    def goals(self) -> Sequence[float]:
        return self.pursued[1:]

    def measured_axes(self) -> Sequence[float]:
        return list(super().measured_axes())[1:]


async def results_of(robot: Robot, *names: str) -> dict[str, Result]:
    async with running_bridge(robot) as bridge:
        subject = Subject(Place(*bridge.address))
        found = {}
        for case in CASES:
            if case.name in names:
                found[case.name] = await play(subject, case)
                await subject.clean_up()
        return found


async def test_the_bridge_passes() -> None:
    results = await results_of(HangingArm(sag=0.05), *(case.name for case in ABOUT_GOALS))
    assert len(results) == len(ABOUT_GOALS) == 9
    assert {name: result.detail for name, result in results.items() if result.outcome is not Outcome.OK} == {}


async def test_cases_about_other_things_move_a_goal_axis_where_the_robot_has_no_other() -> None:
    names = (
        "reset_then_neutral",
        "executes",
        "repeat",
        "copies",
        "moves",
        "hold",
        "rest",
        "lost_link",
        "new_link",
        "stop_latches",
        "late",
    )
    results = await results_of(OnlyArm(sag=0.05), *names, "goal_conflict")
    assert {name: (result.outcome, result.detail) for name, result in results.items()} == dict.fromkeys(
        (*names, "goal_conflict"), (Outcome.OK, "")
    )


async def test_they_do_not_apply_to_a_robot_without_goal_axes() -> None:
    async with running_plain_bridge() as bridge:
        results = [await play(Subject(Place(*bridge.address)), case) for case in ABOUT_GOALS]
    assert {result.detail for result in results} == {"the description has no goal axes"}


def creeps(axis: GoalAxis, value: float | None, speed: float) -> None:
    if value is not None and not axis.is_driven:
        axis.goal -= 0.05  # as if the goal were measured anew below a load
    drive(axis, value, speed)


def ignores_speed(axis: GoalAxis, value: float | None, speed: float) -> None:
    drive(axis, value, 1.0)


def goes_on(shaper: AxisShaper, now: float, dt: float) -> list[float]:
    shaper._deadline = math.inf
    return step(shaper, now, dt)


def sags(shaper: AxisShaper) -> None:
    rest(shaper)
    for axis in shaper._axes:
        if isinstance(axis, GoalAxis):
            axis.goal -= 0.01  # as if the goal were measured anew below a load


def is_where_it_is(self: CommandValues, values: Sequence[float | None]) -> bool:
    return not all(value in (None, 0.0, 0.2) for value in values)


drive, rest, step = GoalAxis.drive, AxisShaper.rest, AxisShaper.step

FAULTS: dict[str, tuple[object, str, object]] = {
    "goals_in_feedback": (AxisShaper, "goals", property(lambda shaper: [None] * 6)),
    "goal_neutral": (CommandValues, "moves", is_where_it_is),
    "goal_engage": (GoalAxis, "drive", creeps),
    "goal_engage after a rest": (AxisShaper, "rest", sags),
    "goal_reached": (goal_axis, "stopping_speed", lambda distance, braking, dt: math.inf if distance else 0.0),
    "goal_speed": (GoalAxis, "drive", ignores_speed),
    "goal_hold": (AxisShaper, "step", goes_on),
    "goal_jump": (CommandValues, "jump", lambda self, values: ""),
    "goal_wrap": (goal_axis, "shorter_way", lambda place, target, wrap: target - place),
    "goal_conflict": (CommandValues, "misfit", lambda self, values, speed=1.0: None),
}


@pytest.mark.parametrize("name", FAULTS)
async def test_a_planted_fault_is_found_by_the_case_that_is_about_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert {fault.split()[0] for fault in FAULTS} == {case.name for case in ABOUT_GOALS}
    where, what, fault = FAULTS[name]
    monkeypatch.setattr(where, what, fault)
    case = name.split()[0]
    result = (await results_of(HangingArm(), case))[case]
    assert result.outcome is not Outcome.OK, result
