"""The words after `lockstep robot lerobot`."""

import pytest

from lockstep.robot_bridge.errors import SettingsError
from lockstep.robot_bridge.robots.lerobot import read_flags


def test_flags_of_lerobots_commands_pass_as_they_are() -> None:
    words = ["--robot.type=so101_follower", "--robot.port", "/dev/ttyACM0", "--robot.id=-a"]
    assert read_flags(words) == (
        "",
        ["--robot.type=so101_follower", "--robot.port=/dev/ttyACM0", "--robot.id=-a"],
    )


@pytest.mark.parametrize("words", [["--type", "koch_follower"], ["--type=koch_follower"]])
def test_the_type_may_be_said_shortly(words: list[str]) -> None:
    assert read_flags(words) == ("", ["--robot.type=koch_follower"])


def test_a_class_may_be_named() -> None:
    assert read_flags(["my.arm:Arm", "--robot.id=a"]) == ("my.arm:Arm", ["--robot.id=a"])


@pytest.mark.parametrize("words", [["so101"], ["--port", "5"], ["--robot.id"], ["a:B", "c:D"], ["--teleop.type=x"]])
def test_any_other_word_is_an_error(words: list[str]) -> None:
    with pytest.raises(SettingsError):
        read_flags(words)
