"""Postures that the settings of a ROS 2 arm name are actions."""

import math
from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import SettingsError
from lockstep.robot_bridge.robots.ros2 import read_settings
from lockstep.robot_bridge.robots.ros2.saved_poses import pose_goals
from tests.robot_bridge.robots.ros2.test_tool_settings import settings

HOME = "[0, -1, 1, 0, 0.5, 4]"


def test_postures_are_moving_actions_before_the_others(tmp_path: Path) -> None:
    beep = "services: [{name: beep, service: /beep}]\n"
    arm = f"  goals: true\n  poses: {{home: {HOME}, look_up: {HOME}}}\n"
    _, description = read_settings(settings(tmp_path, arm, more=beep))
    actions = [(action.name, action.label, action.moves) for action in description.actions]
    assert actions == [("home", "Home", True), ("look_up", "Look up", True), ("beep", "beep", False)]


def test_goals_are_those_of_the_joints_axes_and_wrap_where_these_do(tmp_path: Path) -> None:
    base = "base:\n  forward: {maximum: 0.5}\n"
    arm = f"  tool: {{tip: wrist_3}}\n  poses: {{home: {HOME}}}\n"
    file, description = read_settings(settings(tmp_path, arm, more=base))
    assert file.arm is not None
    goals = pose_goals(file.arm, description.axes)["home"]
    assert goals == pytest.approx({1: 0, 2: -1, 3: 1, 4: 0, 5: 0.5, 6: 4 - math.tau})


@pytest.mark.parametrize(
    ("arm", "words"),
    [
        (f"  poses: {{home: {HOME}}}\n", r"line 5: arm\.poses: poses need axes that are goals"),
        ("  goals: true\n  poses: {home: [0, 1]}\n", r"home: needs one value for each of the 6 joints, not 2"),
        ("  goals: true\n  poses:\n    far:\n      - 4\n      - 0\n      - 0\n      - 0\n      - 0\n      - 0\n",
         r"line 8: arm\.poses\.far\[0\]: 4 is not in the range of shoulder_pan_joint, -3 to 3"),
        ("  goals: true\n  poses: {home: [0, -1, 1, 0, 0.5, .inf]}\n", r"home\[5\]: needs a number"),
        ("  goals: true\n  poses: {home: [0, -1, 1, 0, 0.5, .nan]}\n", r"home\[5\]: needs a number"),
        ("  goals: true\n  poses: {home: [0, -1, 1, 0, 0.5, up]}\n", r"poses"),
        (f"  goals: true\n  poses: {{beep: {HOME}}}\n", r"arm\.poses\.beep: is the name of another action"),
        ("  goals: true\n  poses: {" + ", ".join(f"p{n}: {HOME}" for n in range(13)) + "}\n", r"arm\.poses: .*12"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named_with_its_place(tmp_path: Path, arm: str, words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        read_settings(settings(tmp_path, arm, more="services: [{name: beep, service: /beep}]\n"))
