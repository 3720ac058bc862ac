"""The cases of `lockstep check`, against the robot in C and our own bridge: what docs/robot-link.md promises."""

import re
from pathlib import Path

from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play_all
from lockstep.robot_bridge.conformance.cases.action_cases import ACTION_CASES
from lockstep.robot_bridge.conformance.cases.goal_cases import GOAL_CASES
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.docs.examples.robots import Robot, in_python, moving
from tests.robot_bridge.bridge_helpers import Operator

LAST = "action_hold"
AWAY = 1.0  # m from home: the way there takes longer than the case
PAGE = Path(__file__).parents[3] / "docs" / "robot-link.md"


async def test_every_case_that_applies_passes(robot: Robot) -> None:
    results = await play_all(Subject(Place(*robot.address)), CASES, lambda result: None)
    wrong = [result for result in results if result.outcome not in (Outcome.OK, Outcome.NOT_APPLICABLE)]
    assert wrong == []
    skipped = {result.case.name for result in results if result.outcome is Outcome.NOT_APPLICABLE}
    of_actions, of_goals = ({case.name for case in cases} for cases in (ACTION_CASES, GOAL_CASES))
    # By the last case of an action the others have brought our robot home.
    assert skipped == {"secret", "warning"} | of_goals | ({LAST} if robot.has_actions else of_actions)


async def test_the_case_for_which_the_others_leave_no_way_passes_by_itself(tmp_path: Path) -> None:
    async with in_python(tmp_path) as robot:
        async with RobotLink(*robot.address, "operator", name="test") as link:
            driver = Operator(link)
            await driver.next(Feedback)
            await driver.arm()
            while driver.feedback.joints[0] < AWAY:
                await driver.drive(moving(driver))
            await driver.heard(lambda feedback: feedback.at_rest)
        cases = [case for case in CASES if case.name == LAST]
        results = await play_all(Subject(Place(*robot.address)), cases, lambda result: None)
    assert [(result.case.name, result.outcome) for result in results] == [(LAST, Outcome.OK)]


def test_every_case_names_a_heading_of_the_protocol_page() -> None:
    headings = set(re.findall(r"^#+ (.+)$", PAGE.read_text(), re.MULTILINE))
    assert {case.section for case in CASES} <= headings
    assert len({case.name for case in CASES}) == len(CASES)
