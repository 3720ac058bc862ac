"""The cases of `lockstep check`, against the robot in C and our own bridge: what docs/robot-link.md promises."""

import re
from pathlib import Path

from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play_all
from lockstep.robot_bridge.conformance.place import Place
from tests.docs.examples.robots import Robot

PAGE = Path(__file__).parents[3] / "docs" / "robot-link.md"


async def test_every_case_that_applies_passes(robot: Robot) -> None:
    results = await play_all(Subject(Place(*robot.address)), CASES, lambda result: None)
    wrong = [result for result in results if result.outcome not in (Outcome.OK, Outcome.NOT_APPLICABLE)]
    assert wrong == []
    skipped = {result.case.name for result in results if result.outcome is Outcome.NOT_APPLICABLE}
    # A robot from before there were actions is right without them, and one that is at home already has no way to go.
    assert {name for name in skipped if not name.startswith("action_")} == {"secret", "warning"}


def test_every_case_names_a_heading_of_the_protocol_page() -> None:
    headings = set(re.findall(r"^#+ (.+)$", PAGE.read_text(), re.MULTILINE))
    assert {case.section for case in CASES} <= headings
    assert len({case.name for case in CASES}) == len(CASES)
