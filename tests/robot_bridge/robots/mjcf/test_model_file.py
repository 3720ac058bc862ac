from pathlib import Path

import pytest
from typer.testing import CliRunner

from lockstep.robot_bridge import cli
from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.robots.mjcf.model_file import load_model
from tests.robot_bridge.robots.mjcf.models import ARM, EXAMPLE, model_file, one_joint


def test_the_example_is_a_model_that_can_be_driven() -> None:
    assert load_model(EXAMPLE).nu == 5


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not well-formed XML"),
        ("<mujoco><worldbody>", "not well-formed XML"),
        ("this is no XML", "not well-formed XML"),
        ("<mujoco/>", "no actuators"),
        (one_joint(""), "no actuators"),
        (one_joint('<motor joint="nobody"/>'), "not a valid MuJoCo model"),
        ('<mujoco><asset><mesh file="nope.stl"/></asset></mujoco>', "names a file that is missing"),
        (one_joint('<motor joint="j"/>' * 65), "65 actuators"),
        (one_joint('<motor joint="j"/>').replace("0.002", "0.5"), "timestep"),
    ],
)
def test_a_model_that_cannot_be_driven_is_refused_in_one_sentence(tmp_path: Path, text: str, reason: str) -> None:
    path = model_file(tmp_path, text)
    with pytest.raises(ModelError, match=reason) as error:
        load_model(path)
    assert "\n" not in error.value.detail
    assert str(path) in error.value.detail


def test_a_file_that_is_not_there_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="does not exist"):
        load_model(tmp_path / "nobody.xml")
    with pytest.raises(ModelError, match="is a folder"):
        load_model(tmp_path)


def test_bytes_that_are_no_model_are_refused(tmp_path: Path) -> None:
    for name in ("model.xml", "model.mjb"):
        path = tmp_path / name
        path.write_bytes(bytes(range(256)) * 8)
        with pytest.raises(ModelError):
            load_model(path)


def test_the_command_says_why_and_ends(tmp_path: Path) -> None:
    result = CliRunner().invoke(cli.robot_app, ["--mjcf", str(tmp_path / "nobody.xml"), "--port", "0"])
    assert result.exit_code == 2
    assert "nobody.xml does not exist" in result.output


def test_two_robots_at_once_are_one_too_many(tmp_path: Path) -> None:
    path = str(model_file(tmp_path, ARM))
    result = CliRunner().invoke(cli.robot_app, ["--mjcf", path, "--ros2", path, "--port", "0"])
    assert result.exit_code == 2
