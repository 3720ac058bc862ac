"""Settings of `lockstep robot` in a TOML file."""

import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge import cli
from lockstep.robot_bridge.errors import SettingsError
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.robot_bridge.settings_file import read_settings_file

DEPLOY = Path(__file__).parents[2] / "docs" / "deploy.md"
Start = Callable[..., tuple[Result, Mapping[str, Any]]]


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Start:
    """Starts `lockstep robot` with a file up to where a bridge would run, and returns what it would run with."""
    monkeypatch.chdir(tmp_path)

    def run(text: str, *words: str, by_flag: bool = True, **environment: str) -> tuple[Result, Mapping[str, Any]]:
        found: dict[str, Any] = {}

        async def serve(name: str, make: object, settings: BridgeSettings, as_json: bool) -> None:
            found.update(name=name, settings=settings)

        monkeypatch.setattr(cli, "_serve", serve)
        path = tmp_path / "robot.toml"
        path.write_text(text)
        flags = ["--config", str(path)] if by_flag else []
        given = environment if by_flag else {"LOCKSTEP_ROBOT_CONFIG": str(path), **environment}
        return CliRunner().invoke(cli.robot_app, [*words, *flags], env=given, terminal_width=200), found

    return run


@pytest.mark.parametrize("by_flag", [True, False])
def test_the_file_sets_what_flags_and_the_name_set(start: Start, tmp_path: Path, by_flag: bool) -> None:
    (tmp_path / "secret").write_text(32 * "s")
    text = f"""
        name = "planar"
        port = 5700
        operator_grace = 3.5
        event_strip = true
        listen = false
        link_secret_file = "{tmp_path / "secret"}"
        state_dir = "{tmp_path / "state"}"
    """
    result, found = start(text, by_flag=by_flag)
    assert result.exit_code == 0, result.output
    settings = found["settings"]
    assert (found["name"], settings.port, settings.operator_grace, settings.event_strip) == ("planar", 5700, 3.5, True)
    assert settings.secret is not None
    assert settings.secret.reveal() == 32 * "s"
    assert settings.state_dir == tmp_path / "state"


def test_the_environment_goes_before_the_file_and_flags_before_both(start: Start, tmp_path: Path) -> None:
    for name in ("file", "environment", "flag"):
        (tmp_path / name).write_text(32 * name[0])
    text = f'name = "planar"\nport = 5700\nevent_strip = true\nlink_secret_file = "{tmp_path / "file"}"'
    variable = {"LOCKSTEP_LINK_SECRET_FILE": str(tmp_path / "environment")}
    for words, first in ((), "e"), (("--link-secret-file", str(tmp_path / "flag")), "f"):
        _, found = start(text, *words, **variable)
        assert found["settings"].secret.reveal()[0] == first
    result, found = start(text, "mobile-manipulator", "--port", "5800", "--no-event-strip")
    assert result.exit_code == 0, result.output
    assert (found["name"], found["settings"].port) == ("mobile-manipulator", 5800)
    assert found["settings"].event_strip is False


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("port = ", "robot.toml: "),
        ("prot = 80", "prot is not a setting; did you mean port?"),
        ("port = 70000", "--port"),
        ("port = 5.7", "--port"),
        ('listen = "perhaps"', "--listen"),
        ("port = [1]", "port has to be a text, a number, true or false"),
        ("[media]\nquality = true", "media is not a setting"),
        ('config = "other.toml"', "config is not a setting"),
        ('pair = "K7-3F9QW-2MXBD"', "pair is not a setting"),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused(start: Start, text: str, said: str) -> None:
    result, found = start(text)
    assert (result.exit_code, found) == (2, {})
    assert said in result.output
    assert "Traceback" not in result.output


def test_what_is_no_file_or_too_long_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    with (tmp_path / "large.toml").open("wb") as file:
        file.truncate(1 << 40)
    for name, said in ("fifo", "not a regular file"), ("large.toml", "longer than"), ("none", "No such file"):
        with pytest.raises(SettingsError, match=said):
            read_settings_file(tmp_path / name, ["port"])


def test_the_file_in_the_guide_is_one_of_a_robot(start: Start, tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(# /etc/lockstep/robot.toml.*?)```", DEPLOY.read_text(), re.DOTALL)
    (tmp_path / "robot.key").write_text(32 * "k")
    result, found = start(text.replace("/etc/lockstep", str(tmp_path)))
    assert result.exit_code == 0, result.output
    assert found["settings"].console is not None


@pytest.mark.parametrize("number", ["1" + "0" * 5000, "0x1" + "0" * 5000, "0x1" + "0" * 20])
def test_a_number_of_too_many_digits_is_a_usage_error(start: Start, number: str) -> None:
    result, found = start(f"port = {number}\n", "planar")
    assert result.exit_code == 2
    assert not found
    assert len(result.output.splitlines()) == 1


def test_an_unknown_name_makes_no_line_of_its_own(start: Start) -> None:
    result, _ = start('"a\\nall is well" = 1\n', "planar")
    assert result.exit_code == 2
    assert len(result.output.splitlines()) == 1


@pytest.mark.parametrize("name", ["LOCKSTEP_LINK_SECRET", "LOCKSTEP_LINK_SECRET_FILE"])
def test_a_secret_of_the_environment_goes_before_that_of_the_file(start: Start, tmp_path: Path, name: str) -> None:
    (tmp_path / "secret").write_text(32 * "s")
    (tmp_path / "other").write_text(32 * "o")
    given = 32 * "o" if name == "LOCKSTEP_LINK_SECRET" else str(tmp_path / "other")
    result, found = start(f'link_secret_file = "{tmp_path / "secret"}"\n', "planar", **{name: given})
    assert result.exit_code == 0, result.output
    assert found["settings"].secret.reveal() == LinkSecret(32 * "o").reveal()
    result, found = start(f'link_secret_file = "{tmp_path / "secret"}"\n', "planar", **{name: ""})
    assert found["settings"].secret is None
