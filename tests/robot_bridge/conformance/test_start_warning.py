"""A robot that warns before it moves, and one that cannot move, are checked as the others are."""

import msgspec

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play_all
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.robots.planar import PlanarRobot
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.test_start_warning import LampRobot


class Statue(PlanarRobot):
    """Every axis is a value that it has for ever."""

    def describe(self) -> RobotDescription:
        still = super().describe()
        axes = tuple(msgspec.structs.replace(axis, minimum=0.0, maximum=0.0) for axis in still.axes)
        return msgspec.structs.replace(still, axes=axes)


async def outcomes(robot: PlanarRobot, *names: str) -> list[str]:
    cases = [case for case in CASES if case.name in names]
    async with Bridge(robot, BridgeSettings(port=0)) as bridge:
        results = await play_all(Subject(Place(*bridge.address)), cases, lambda result: None)
    return [f"{result.case.name} {result.outcome} {result.detail}".strip() for result in results]


async def test_moving_cases_wait_until_the_robot_has_warned() -> None:
    names = ("warning", "new_link", "late", "reset_then_neutral")
    found = await outcomes(LampRobot(), *names)
    assert sorted(found) == sorted(f"{name} {Outcome.OK}" for name in names)


async def test_a_case_that_needs_motion_does_not_apply_where_nothing_moves() -> None:
    assert await outcomes(Statue(), "hold", "executes") == [
        "executes ok",
        "hold not applicable no axis of this robot moves",
    ]
