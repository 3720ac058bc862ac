from pathlib import Path
from typing import Any

import pytest

from lockstep.server.fleet.robots import robot_settings
from lockstep.server.settings import Settings
from lockstep.server.util.robot_names import BadFleet

TWO = ("left=tcp://h:1", "right=tcp://h:2")


def fleet_file(folder: Path, text: str) -> Path:
    path = folder / "fleet.toml"
    path.write_text(text)
    return path


def test_each_robot_has_the_consoles_settings_and_its_own_address() -> None:
    found = robot_settings(Settings(robots=TWO, seat_timeout=7.0))
    assert {name: each.robot for name, each in found.items()} == {"left": "tcp://h:1", "right": "tcp://h:2"}
    assert all(each.seat_timeout == 7.0 and not each.is_fleet for each in found.values())


def test_the_environment_counts_for_every_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOCKSTEP_MAX_PEERS", "17")
    monkeypatch.setenv("LOCKSTEP_ROBOTS", "left=tcp://h:1, right=tcp://h:2")
    assert [each.max_peers for each in robot_settings(Settings()).values()] == [17, 17]


def test_the_file_gives_a_robot_what_the_others_have_not(tmp_path: Path) -> None:
    path = fleet_file(
        tmp_path,
        """
        [robots.gate]
        robot = "tcp://h:3"
        cameras = "front=rtsp://camera/1"
        max_peers = 5
        [robots.gate.media]
        quality = false
        """,
    )
    found = robot_settings(Settings(robots=TWO, fleet_file=path, max_peers=50))
    assert list(found) == ["left", "right", "gate"]
    assert [each.max_peers for each in found.values()] == [50, 50, 5]
    assert [len(each.sources) for each in found.values()] == [0, 0, 1]
    assert not found["gate"].media.quality


def test_recordings_of_each_robot_go_into_a_directory_of_its_own(tmp_path: Path) -> None:
    found = robot_settings(Settings(robots=TWO, recording={"directory": tmp_path}))  # type: ignore[arg-type]
    assert {each.recording.directory for each in found.values()} == {tmp_path / "left", tmp_path / "right"}


def test_a_robot_that_sets_something_of_its_recordings_keeps_a_directory_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = """
        [robots.left]
        robot = "tcp://h:1"
        recording = { automatic = true }
        [robots.right]
        robot = "tcp://h:2"
        recording = { automatic = true, directory = "/elsewhere" }
        """
    path = fleet_file(tmp_path, tables)
    expected = {"left": tmp_path / "left", "right": Path("/elsewhere")}
    by_flag = Settings(fleet_file=path, recording={"directory": tmp_path})  # type: ignore[arg-type]
    monkeypatch.setenv("LOCKSTEP_RECORDING__DIRECTORY", str(tmp_path))
    for settings in (by_flag, Settings(fleet_file=path)):
        found = robot_settings(settings)
        assert {name: each.recording.directory for name, each in found.items()} == expected
        assert all(each.recording.automatic for each in found.values())


def test_robots_of_a_fleet_serve_foxglove_at_ports_of_their_own(tmp_path: Path) -> None:
    tables = """
        [robots.left]
        robot = "tcp://h:1"
        foxglove = { port = 8765 }
        [robots.right]
        robot = "tcp://h:2"
        """
    found = robot_settings(Settings(fleet_file=fleet_file(tmp_path, tables)))
    assert {name: each.foxglove.port for name, each in found.items()} == {"left": 8765, "right": None}
    with pytest.raises(BadFleet, match="left and right have the same port 8765"):
        robot_settings(Settings(robots=TWO, foxglove={"port": 8765}))  # type: ignore[arg-type]
    with pytest.raises(BadFleet, match="left and right have the same port 9876"):
        robot_settings(Settings(robots=TWO, rerun={"to": "9876", "public": True}))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("", "no_robots"),
        ("robots = 3", "fleet_unreadable"),
        ("[robots.left", "fleet_unreadable"),
        ('[robots.left]\nrobot = "tcp://h:1"\n[else]\n', "fleet_unreadable"),
        ("[robots.left]\n", "robot_without_address"),
        ('[robots."A b"]\nrobot = "tcp://h:1"', "bad_robot_name"),
        ('[robots.left]\nrobot = "h:1"', "bad_setting"),
        ('[robots.left]\nrobot = "tcp://h:1"\nport = 80', "setting_of_the_console"),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused_by_name(tmp_path: Path, text: str, name: str) -> None:
    with pytest.raises(BadFleet) as refused:
        robot_settings(Settings(fleet_file=fleet_file(tmp_path, text)))
    assert refused.value.name == name


def test_a_file_that_is_not_there_is_refused() -> None:
    with pytest.raises(BadFleet, match="fleet_unreadable"):
        robot_settings(Settings(fleet_file=Path("/nowhere/fleet.toml")))


def test_a_robot_of_the_flag_and_of_the_file_is_named_twice(tmp_path: Path) -> None:
    path = fleet_file(tmp_path, '[robots.left]\nrobot = "tcp://h:1"')
    with pytest.raises(BadFleet, match="robot_named_twice"):
        robot_settings(Settings(robots=TWO, fleet_file=path))


@pytest.mark.parametrize("shared", [{"cameras": ["rtsp://c/1"]}, {"speaker": "file:/tmp/x.wav"}])
def test_what_hangs_at_one_robot_is_not_given_to_all(shared: dict[str, Any]) -> None:
    with pytest.raises(BadFleet, match="setting_of_one_robot"):
        robot_settings(Settings(robots=TWO, **shared))


def test_a_bad_name_is_a_bad_setting() -> None:
    with pytest.raises(ValueError, match="bad_robot_name"):
        Settings(robots=("A=tcp://h:1",))


def test_the_variable_of_one_robot_takes_a_name_as_the_flag_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOCKSTEP_ROBOT", "left=tcp://h:1,right=tcp://h:2")
    assert Settings().is_fleet
    assert {name: each.robot for name, each in robot_settings(Settings()).items()} == {
        "left": "tcp://h:1",
        "right": "tcp://h:2",
    }
    assert list(robot_settings(Settings(robots=("third=tcp://h:3",)))) == ["third"]
    assert not Settings(robot="tcp://h:4").is_fleet
