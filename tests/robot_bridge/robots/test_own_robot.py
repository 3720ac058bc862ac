"""A robot named as module:Class, or by an entry point: what is wrong with it is said in one line."""

import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lockstep.robot_bridge.cli import robot_app
from lockstep.robot_bridge.robots.own_robot import installed_robots
from lockstep.robot_bridge.robots.planar import PlanarRobot
from lockstep.robot_bridge.robots.registry import create_robot, is_robot, robot_names
from lockstep.server.cli.main import app

MODULE = """
import math
from dataclasses import dataclass

import msgspec

from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.planar import PlanarRobot

class Good(PlanarRobot):
    pass

class Outer:
    Inner = Good

def make():
    return Good()

class NoRobot:
    pass

class Abstract(PlanarRobot):
    def __init__(self, port):
        pass

class Raises(PlanarRobot):
    def __init__(self):
        raise OSError("no such\\nserial port")

class Unplugged(PlanarRobot):
    def __init__(self):
        raise RobotUnavailable("switch the arm on")

class DescribesNothing(PlanarRobot):
    def describe(self):
        return None

class DescribesRaising(PlanarRobot):
    def describe(self):
        return {}["axes"]

class NoAxes(PlanarRobot):
    def describe(self):
        return msgspec.structs.replace(super().describe(), axes=())

class TextAsNumber(PlanarRobot):
    def describe(self):
        return msgspec.structs.replace(super().describe(), hold="long")

number = 5
"""

WRONG = [
    ("own_arm:", 2, "'own_arm:' is not module:Class"),
    ("own arm:Good", 2, "'own arm:Good' is not module:Class"),
    ("no_arm:Good", 2, "no_arm:Good: no module 'no_arm' here or among the installed packages"),
    ("own_arm.deep:Good", 2, "no module 'own_arm.deep'"),
    ("own_arm:Absent", 2, "own_arm:Absent: own_arm has no 'Absent'"),
    ("own_arm:NoRobot", 2, "own_arm:NoRobot is not a robot: the class does not inherit"),
    ("own_arm:number", 2, "own_arm:number is not a robot: it is a int, not a class"),
    ("own_arm:math.sqrt", 2, "own_arm:math.sqrt failed: TypeError"),
    ("own_arm:Abstract", 2, "own_arm:Abstract failed: TypeError"),
    ("own_arm:Raises", 2, "own_arm:Raises failed: OSError: no such serial port (own_arm.py, line 28)"),
    ("own_arm:Unplugged", 1, "switch the arm on"),
    ("own_arm:DescribesNothing", 2, "describe() returned a NoneType, not a RobotDescription"),
    ("own_arm:DescribesRaising", 2, "describe() failed: KeyError: 'axes' (own_arm.py, line 40)"),
    ("own_arm:NoAxes", 2, "own_arm:NoAxes: describe(): a robot needs at least one axis"),
    ("own_arm:TextAsNumber", 2, "own_arm:TextAsNumber: describe():"),
    ("broken_arm:Good", 2, "importing broken_arm failed: SyntaxError"),
    ("hungry_arm:Good", 2, "hungry_arm needs the module 'no_such_driver', which is not installed"),
]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with modules of somebody's own in it."""
    (tmp_path / "own_arm.py").write_text(MODULE)
    (tmp_path / "broken_arm.py").write_text("class Good(:\n")
    (tmp_path / "hungry_arm.py").write_text("import no_such_driver\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [each for each in sys.path if each])
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    for name in ("own_arm", "broken_arm", "hungry_arm"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return tmp_path


@pytest.mark.parametrize("spec", ["own_arm:Good", "own_arm:make", "own_arm:Outer.Inner"])
def test_a_class_of_the_working_directory_is_a_robot(spec: str) -> None:
    assert isinstance(create_robot(spec), PlanarRobot)


@pytest.mark.parametrize(("spec", "code", "words"), WRONG, ids=[spec for spec, _, _ in WRONG])
def test_what_is_wrong_with_it_is_one_line_and_a_usage_error(spec: str, code: int, words: str) -> None:
    asked = CliRunner().invoke(robot_app, [spec, "--port", "0"])
    assert asked.exit_code == code
    said = [line for line in asked.stderr.splitlines() if "is in memory" not in line]
    assert len(said) == 1, said
    assert said[0].startswith("lockstep robot: ")
    assert words in said[0]


def test_an_installed_package_names_robots_by_its_entry_points(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    packaged = folder / "own_arm-1.0.dist-info"
    packaged.mkdir()
    (packaged / "METADATA").write_text("Metadata-Version: 2.1\nName: own-arm\nVersion: 1.0\n")
    (packaged / "entry_points.txt").write_text("[lockstep.robots]\nown-arm = own_arm:Good\nplanar = own_arm:Outer\n")
    monkeypatch.syspath_prepend(str(folder))
    assert installed_robots()["own-arm"] == "own_arm:Good"
    assert {"own-arm", "planar"} <= set(robot_names())
    assert is_robot("own-arm")
    assert type(create_robot("own-arm")).__name__ == "Good"
    assert type(create_robot("planar")) is PlanarRobot, "a robot that comes with Lockstep is not replaced"


def test_a_further_argument_is_a_usage_error() -> None:
    asked = CliRunner().invoke(robot_app, ["planar", "arm"])
    assert asked.exit_code == 2
    assert "one argument too many" in asked.output


def test_up_with_a_class_that_is_not_there_ends_as_a_usage_error_with_the_bridge_s_line(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    given = ["up", "--robot", "own_arm:Absent", "--port", "0", "--robot-port", "0", "--state-dir", str(folder)]
    asked = CliRunner().invoke(app, given)
    assert asked.exit_code == 2, asked.output
    written = capfd.readouterr().err + asked.output
    assert "own_arm:Absent: own_arm has no 'Absent'" in written
    assert "Traceback" not in written
    assert "the robot bridge ended" not in written
