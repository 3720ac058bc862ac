"""`lockstep ros2 discover` where it cannot begin, and the file that it writes."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from lockstep.robot_bridge.errors import SettingsError
from lockstep.robot_bridge.robots.ros2.discovery import cli
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft import Draft

GOOD = "name: tug\nbase:\n  forward: {maximum: 0.5}\n"
BAD = "name: tug\n"


def discover(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(cli.ros2_app, ["discover", *arguments])
    return done.exit_code, done.output


def test_a_python_without_ros_is_named_with_the_way_out(tmp_path: Path) -> None:
    code, said = discover("--out", str(tmp_path / "robot.yaml"), "--yes")
    assert code == 1
    assert "ROS 2 is missing" in said
    assert "--robot-python" in said


def test_a_python_that_is_not_there_is_named(tmp_path: Path) -> None:
    code, _ = discover("--out", str(tmp_path / "robot.yaml"), "--robot-python", str(tmp_path / "python"))
    assert code == 127


def test_a_folder_that_is_not_there_is_named_before_it_listens(tmp_path: Path) -> None:
    code, said = discover("--out", str(tmp_path / "nowhere" / "robot.yaml"))
    assert (code, "there is no folder" in said, "Listening" in said) == (2, True, False)


def test_bodies_that_make_the_description_too_long_are_left_out(tmp_path: Path) -> None:
    out = tmp_path / "robot.yaml"
    cli.write(out, Draft(BAD, GOOD, [], 0))
    assert out.read_text() == GOOD
    assert list(tmp_path.iterdir()) == [out]


def test_a_file_that_the_bridge_would_not_read_does_not_replace_another(tmp_path: Path) -> None:
    out = tmp_path / "robot.yaml"
    out.write_text(GOOD)
    with pytest.raises(SettingsError, match="robot.yaml.part, line 1"):
        cli.write(out, Draft(BAD, "", [], 0))
    assert out.read_text() == GOOD
