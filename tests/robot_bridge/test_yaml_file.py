import os
from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import SettingsError
from lockstep.robot_bridge.yaml_file import YamlFile


def test_a_fifo_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "robot.yaml")
    with pytest.raises(SettingsError, match="not a regular file"):
        YamlFile(tmp_path / "robot.yaml")


def test_a_device_is_refused_and_not_read_to_its_end() -> None:
    with pytest.raises(SettingsError, match="not a regular file"):
        YamlFile(Path("/dev/zero"))


def test_a_folder_and_a_missing_file_are_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="directory"):
        YamlFile(tmp_path)
    with pytest.raises(SettingsError, match="No such file"):
        YamlFile(tmp_path / "none.yaml")


def test_of_a_file_with_holes_no_more_than_the_bound_is_read(tmp_path: Path) -> None:
    path = tmp_path / "large.yaml"
    with path.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(SettingsError, match="longer than 1048576 bytes"):
        YamlFile(path)


def test_aliases_that_repeat_each_other_make_no_more_values_than_the_bound(tmp_path: Path) -> None:
    lines = ["a0: &a0 [1, 2, 3, 4, 5, 6, 7, 8, 9]"]
    lines += [f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 9)}]" for level in range(1, 12)]
    path = tmp_path / "laughs.yaml"
    path.write_text("\n".join(lines))
    with pytest.raises(SettingsError, match="more than 100000 values"):
        YamlFile(path)
