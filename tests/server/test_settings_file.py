"""Settings of a TOML file, for a console with one robot and for a fleet."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from lockstep.server.fleet.robots import robot_settings
from lockstep.server.settings import Settings
from lockstep.server.settings_file import SettingsFileUnusable, exposed_secrets, read_settings_file
from lockstep.server.util.robot_names import BadFleet

DEPLOY = Path(__file__).resolve().parents[2] / "docs" / "deploy.md"
ONE = """
robot = "tls://10.0.0.5:5600"
port = 9000
ice_hosts = ["10.0.0.1", "10.0.0.2"]
speed_cap = "on"
[media]
quality = false
[recording]
directory = "/srv/recordings"
"""
FLEET = """
port = 9000
seat_timeout = 5.0
[recording]
directory = "/srv/recordings"
[robots.left]
robot = "tcp://10.0.0.5:5600"
[robots.right]
robot = "tcp://10.0.0.6:5600"
max_peers = 20
recording = { automatic = true }
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "console.toml"
    path.write_text(text)
    return path


def test_the_file_sets_the_environment_goes_before_it_and_flags_before_both(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, ONE)
    monkeypatch.setenv("LOCKSTEP_CONFIG", str(path))
    found = Settings()
    assert (found.robot, found.port, found.ice_hosts) == ("tls://10.0.0.5:5600", 9000, ("10.0.0.1", "10.0.0.2"))
    assert (found.speed_cap, found.media.quality, str(found.recording.directory)) == ("on", False, "/srv/recordings")
    monkeypatch.setenv("LOCKSTEP_PORT", "9001")
    monkeypatch.setenv("LOCKSTEP_RECORDING__AUTOMATIC", "true")
    assert (Settings().port, Settings().recording.automatic) == (9001, True)
    assert str(Settings().recording.directory) == "/srv/recordings", "a table is merged with single variables"
    assert Settings(port=9002).port == 9002


def test_a_flag_names_another_file_than_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOCKSTEP_CONFIG", "/nowhere.toml")
    assert Settings(config=written(tmp_path, ONE)).port == 9000
    monkeypatch.setenv("LOCKSTEP_CONFIG", "")
    assert Settings().port == 8000


@pytest.mark.parametrize("by_flag", [True, False])
def test_one_file_has_a_fleets_robots_and_the_consoles_own_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, by_flag: bool
) -> None:
    path = written(tmp_path, FLEET)
    if not by_flag:
        monkeypatch.setenv("LOCKSTEP_CONFIG", str(path))
    settings = Settings(config=path) if by_flag else Settings()
    assert (settings.is_fleet, settings.port) == (True, 9000)
    found = robot_settings(settings)
    assert {name: each.robot for name, each in found.items()} == {
        "left": "tcp://10.0.0.5:5600",
        "right": "tcp://10.0.0.6:5600",
    }
    assert [each.max_peers for each in found.values()] == [200, 20]
    assert [each.seat_timeout for each in found.values()] == [5.0, 5.0]
    assert [str(each.recording.directory) for each in found.values()] == [
        "/srv/recordings/left",
        "/srv/recordings/right",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("port = ", "console.toml: "),
        ("prot = 80", "prot is not a setting; did you mean port?"),
        ("[media]\nqualty = false", "media.qualty is not a setting; did you mean media.quality?"),
        ('config = "other.toml"', "config is not a setting"),
        ('robot = "tcp://h:1"\n[robots.left]\nrobot = "tcp://h:1"', "robot cannot stand beside tables"),
        ('fleet_file = "f.toml"\n[robots.left]\nrobot = "tcp://h:1"', "fleet_file cannot stand beside tables"),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(SettingsFileUnusable, match=re.escape(said)):
        Settings(config=written(tmp_path, text))


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsFileUnusable, match="No such file"):
        Settings(config=tmp_path / "none.toml")
    latin = tmp_path / "latin.toml"
    latin.write_bytes(b'public_url = "\xe9"')
    with pytest.raises(SettingsFileUnusable, match="latin"):
        Settings(config=latin)


@pytest.mark.parametrize(
    ("text", "said"), [("prot = 80", "did you mean port"), ("port = 70000", "port: "), ("port = [1]", "port: ")]
)
def test_the_command_says_what_is_wrong_with_the_file(tmp_path: Path, text: str, said: str) -> None:
    command = [str(Path(sys.executable).with_name("lockstep")), "serve", "--config", str(written(tmp_path, text))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr.startswith("lockstep: ")) == (2, True), done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_the_file_in_the_guide_is_a_file_of_settings(tmp_path: Path) -> None:
    blocks = re.findall(r"```toml\n(?!# /etc/lockstep/robot.toml)(.*?)```", DEPLOY.read_text(), re.DOTALL)
    assert len(blocks) >= 3
    for name in ("link_secret", "left.secret", "right.secret", "robots_left.secret", "robots_right.secret"):
        (tmp_path / name).write_text(32 * "s")
    for text in blocks:
        for folder in ("/etc/lockstep", "/run/credentials/lockstep-console.service"):
            text = text.replace(folder, str(tmp_path))
        settings = Settings(config=written(tmp_path, text))
        if settings.is_fleet:
            robot_settings(settings)


def test_what_is_no_file_too_long_or_too_deep_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(SettingsFileUnusable, match="not a regular file"):
        read_settings_file(tmp_path / "fifo", Settings)
    with pytest.raises(SettingsFileUnusable, match="nested too deeply"):
        read_settings_file(written(tmp_path, f"port = {'[' * 10_000}{']' * 10_000}"), Settings)
    with (tmp_path / "large.toml").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(SettingsFileUnusable, match="longer than"):
        read_settings_file(tmp_path / "large.toml", Settings)
    for name in ("fifo", "console.toml", "large.toml"):
        with pytest.raises(BadFleet) as raised:
            robot_settings(Settings(fleet_file=tmp_path / name))
        assert raised.value.name == "fleet_unreadable"


def test_a_secret_in_a_file_that_everybody_may_read_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, 'secret = "s"\nport = 1\n[robots.left]\nlink_secret = "x"\n[federation]\nboard = ""\n')
    path.chmod(0o640)
    assert exposed_secrets(path, Settings) == []
    path.chmod(0o644)
    assert exposed_secrets(path, Settings) == ["link_secret", "secret"]
    assert exposed_secrets(written(tmp_path, 'link_secret_file = "/run/secret"'), Settings) == []
