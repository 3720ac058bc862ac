"""The cases of `lockstep check`, against the robot in C and our own bridge: what docs/robot-link.md promises."""

import asyncio
import re
from collections.abc import Sequence
from pathlib import Path

from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play_all
from lockstep.robot_bridge.conformance.case import Case
from lockstep.robot_bridge.conformance.cases.action_cases import ACTION_CASES
from lockstep.robot_bridge.conformance.cases.goal_cases import GOAL_CASES
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.docs.examples.robots import Robot, in_c, in_python, moving
from tests.robot_bridge.bridge_helpers import Operator

OF_ACTIONS, OF_GOALS = ({case.name for case in cases} for cases in (ACTION_CASES, GOAL_CASES))
AWAY = 1.0  # m from home: the way there takes longer than the case
PAGE = Path(__file__).parents[3] / "docs" / "robot-link.md"


async def test_every_case_that_applies_passes(tmp_path: Path) -> None:
    """Both at once: most of the time is spent waiting for what must not happen."""
    (tmp_path / "c").mkdir()
    async with in_c(tmp_path / "c") as one, in_python(tmp_path) as other:
        results, ours = await asyncio.gather(*(played(robot, CASES) for robot in (one, other)))
        without_way = {name for name, outcome in ours.items() if outcome is Outcome.NOT_APPLICABLE} & OF_ACTIONS
        # The others have brought our robot home, on a busy machine sooner than elsewhere.
        for case in ACTION_CASES:
            if case.name in without_way:
                await go_away(other)
                ours |= await played(other, [case])
    assert results == expected({"secret", "warning"} | OF_GOALS | OF_ACTIONS)
    assert ours == expected({"secret", "warning"} | OF_GOALS)


def expected(skipped: set[str]) -> dict[str, Outcome]:
    return {case.name: Outcome.NOT_APPLICABLE if case.name in skipped else Outcome.OK for case in CASES}


async def played(robot: Robot, cases: Sequence[Case]) -> dict[str, Outcome]:
    results = await play_all(Subject(Place(*robot.address)), cases, lambda result: None)
    assert [result for result in results if result.outcome not in (Outcome.OK, Outcome.NOT_APPLICABLE)] == []
    return {result.case.name: result.outcome for result in results}


async def go_away(robot: Robot) -> None:
    async with RobotLink(*robot.address, "operator", name="test") as link:
        driver = Operator(link)
        await driver.next(Feedback)
        await driver.arm()
        while driver.feedback.joints[0] < AWAY:
            await driver.drive(moving(driver))
        await driver.heard(lambda feedback: feedback.at_rest)


def test_every_case_names_a_heading_of_the_protocol_page() -> None:
    headings = set(re.findall(r"^#+ (.+)$", PAGE.read_text(), re.MULTILINE))
    assert {case.section for case in CASES} <= headings
    assert len({case.name for case in CASES}) == len(CASES)
