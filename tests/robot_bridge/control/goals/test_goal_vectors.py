"""The cases of tests/vectors/goals.json, as far as they are the bridge's; and that those of the clutch agree."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from lockstep.protocol.description import Axis, Pose
from lockstep.robot_bridge.control.goals.command_values import CommandValues
from lockstep.robot_bridge.control.limits.goal_axis import shorter_way

VECTORS = json.loads((Path(__file__).parents[3] / "vectors" / "goals.json").read_text())
AXES = [Axis(label=axis["name"], slew=1.0, brake=10.0, **axis) for axis in VECTORS["axes"]]
POSES = [Pose(label="", body="", **pose) for pose in VECTORS["poses"]]


def name_of(case: dict[str, Any]) -> str:
    return str(case["name"])


@pytest.mark.parametrize("case", VECTORS["meaning"], ids=name_of)
def test_what_values_mean(case: dict[str, Any]) -> None:
    values = CommandValues(AXES, poses=POSES)
    misfit = values.misfit(case["values"])
    found = misfit[0] if misfit else ("moves" if values.moves(case["values"]) else "neutral")
    assert found == case["is"]


@pytest.mark.parametrize("case", VECTORS["reach"], ids=name_of)
def test_which_goal_is_a_jump(case: dict[str, Any]) -> None:
    places = [math.nan if place is None else place for place in case["places"]]
    values = CommandValues(AXES, poses=POSES, measured=lambda: places)
    assert values.misfit(case["values"]) is None
    assert ("jump" if values.jump(case["values"]) else "executed") == case["is"]


@pytest.mark.parametrize("case", VECTORS["ways"], ids=lambda case: f"{case['place']} to {case['goal']}")
def test_the_shorter_way(case: dict[str, Any]) -> None:
    assert shorter_way(case["place"], case["goal"], case["wrap"]) == pytest.approx(case["way"])


@pytest.mark.parametrize("case", VECTORS["clutch"], ids=name_of)
def test_the_cases_of_the_clutch_say_what_the_page_says(case: dict[str, Any]) -> None:
    """Written down a second time, from docs/robot-link.md: the bridge itself has no clutch."""
    applied: float | None = None
    bound: tuple[float, float] | None = None  # the robot's goal and the device's coordinate when it was engaged
    device = 0.0
    for step in case["steps"]:
        device = step.get("device", device)
        match step["do"]:
            case "feedback":
                applied = step["goal"]
            case "engage":
                bound = None if applied is None else (applied, device)
            case "release":
                bound = None
            case "lost":
                bound = applied = None
        value = None if bound is None else bound[0] + case["scale"] * (device - bound[1])
        assert value == (None if step["value"] is None else pytest.approx(step["value"])), step
