"""`lockstep robot new`: the folder that it writes holds a robot that works as it is.

`tests/bench/first_drive/` starts a console with it, and drives it.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.cli import robot_app
from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play_all
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.new_robot import class_name
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.settings import BridgeSettings

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    """What a test imported of a folder of its own."""
    yield
    for name in [each for each in sys.modules if each.partition(".")[0] == "my_arm"]:
        del sys.modules[name]


def written(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(folder)
    asked = CliRunner().invoke(robot_app, ["new", "my_arm"])
    assert asked.exit_code == 0, asked.output
    assert "lockstep up --robot my_arm:MyArm" in asked.output
    return folder / "my_arm"


def run(folder: Path, *command: str, **environment: str) -> str:
    result = subprocess.run(
        [sys.executable, "-m", *command],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def test_its_own_test_passes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = written(tmp_path, monkeypatch)
    assert "3 passed" in run(folder, "pytest", "-q", "-p", "no:asyncio", "-p", "no:cacheprovider")


def test_what_it_writes_passes_ruff(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = written(tmp_path, monkeypatch)
    run(folder, "ruff", "check", "--no-cache", ".")
    run(folder, "ruff", "format", "--no-cache", "--check", ".")


@pytest.mark.long
def test_what_it_writes_passes_mypy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Mypy reads all of the bridge for it, without a cache."""
    folder = written(tmp_path, monkeypatch)
    run(
        folder,
        "mypy",
        "--cache-dir",
        str(tmp_path / "mypy"),
        MYPYPATH=os.pathsep.join(str(ROOT / part) for part in ("protocol", "robot_bridge")),
    )


async def test_it_passes_the_conformance_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(written(tmp_path, monkeypatch)))
    robot = create_robot("my_arm:MyArm")
    async with Bridge(robot, BridgeSettings(port=0)) as bridge:
        results = await play_all(Subject(Place(*bridge.address)), CASES, lambda result: None)
    assert [result for result in results if result.outcome in (Outcome.FAILED, Outcome.NOT_TRIED)] == []


def test_an_installed_one_is_known_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, site = written(tmp_path, monkeypatch), tmp_path / "site"
    run(folder, "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--no-index", "--target", str(site), ".")
    code = "from lockstep.robot_bridge.robots.registry import create_robot; print(create_robot('my_arm'))"
    said = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert "my_arm.robot.MyArm" in said


def test_a_folder_that_is_there_is_left_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = written(tmp_path, monkeypatch)
    (folder / "my_arm" / "robot.py").write_text("# mine\n")
    asked = CliRunner().invoke(robot_app, ["new", "my_arm"])
    assert asked.exit_code == 2
    assert "exists already" in asked.output
    assert (folder / "my_arm" / "robot.py").read_text() == "# mine\n"


@pytest.mark.parametrize("name", ["9arm", "my-arm", "my arm", "class", "", "_", "__", "../arm", "ärm", "json", "tests"])
def test_a_name_that_python_could_not_import_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    asked = CliRunner().invoke(robot_app, ["new", name])
    assert asked.exit_code == 2
    assert asked.output.startswith("lockstep robot new: ")
    assert list(tmp_path.iterdir()) == []


def test_without_a_name_it_says_what_is_missing() -> None:
    asked = CliRunner().invoke(robot_app, ["new"])
    assert asked.exit_code == 2
    assert "lockstep robot new my_arm" in asked.output


def test_the_class_has_the_name_in_capitals() -> None:
    assert [class_name(each) for each in ("my_arm", "arm", "Arm2_d")] == ["MyArm", "Arm", "Arm2D"]
