"""The systemd units, checked by systemd."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from lockstep.robot_bridge.watchdog.liveness import ALARM, LIMIT
from lockstep.server.fleet.robots import robot_settings
from lockstep.server.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
UNITS = sorted((ROOT / "deploy" / "systemd").glob("*.service"))
DROP_INS = sorted((ROOT / "deploy" / "systemd").glob("*.service.d/*.conf"))
ROS2 = ROOT / "deploy" / "systemd" / "lockstep-robot.service.d" / "ros2.conf"
FLEET = ROOT / "deploy" / "systemd" / "lockstep-console.service.d" / "fleet.conf"
CREDENTIALS = "/run/credentials/lockstep-console.service"  # systemd.exec(5), $CREDENTIALS_DIRECTORY


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_systemd_accepts_the_unit(unit: Path, tmp_path: Path) -> None:
    here = tmp_path / unit.name
    program = Path(sys.executable).with_name("lockstep")
    here.write_text(unit.read_text().replace("/opt/lockstep/.venv/bin/lockstep", str(program)))
    done = subprocess.run(["systemd-analyze", "verify", str(here)], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_the_unit_starts_a_command_that_the_program_has(unit: Path) -> None:
    line = next(line for line in unit.read_text().splitlines() if line.startswith("ExecStart="))
    words = line.split()
    command = [str(Path(sys.executable).with_name("lockstep")), words[1], "--help"]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=60, env={"COLUMNS": "200", "PATH": "/usr/bin"}
    )
    assert done.returncode == 0
    assert [word for word in words if word.startswith("--") and word not in done.stdout] == []


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_the_unit_asks_for_the_robot_links_secret(unit: Path) -> None:
    lines = unit.read_text().splitlines()
    assert "LoadCredential=link_secret:/etc/lockstep/link_secret" in lines
    assert "Environment=LOCKSTEP_LINK_SECRET_FILE=%d/link_secret" in lines


def test_the_bridge_is_started_again_when_it_hangs_and_ends_by_itself_before_systemd_ends_it() -> None:
    lines = next(unit for unit in UNITS if unit.name == "lockstep-robot.service").read_text().splitlines()
    assert {"Type=notify", "Restart=always"} <= set(lines)
    watchdog = next(float(line.partition("=")[2]) for line in lines if line.startswith("WatchdogSec="))
    assert LIMIT < watchdog < ALARM * LIMIT, "its own message comes first; systemd's SIGABRT says where it hung"


def test_the_console_is_started_again_when_it_hangs() -> None:
    lines = next(unit for unit in UNITS if unit.name == "lockstep-console.service").read_text().splitlines()
    assert {"Type=notify", "Restart=always", "WatchdogSec=20"} <= set(lines)


def test_the_bridge_takes_further_options_word_by_word() -> None:
    """`${NAME}` is one word and `$NAME` as many as its value has (systemd.service(5), "Command lines")."""
    lines = next(unit for unit in UNITS if unit.name == "lockstep-robot.service").read_text().splitlines()
    assert "Environment=LOCKSTEP_ROBOT_OPTIONS=" in lines, "systemd warns of a variable that is not set"
    assert next(line for line in lines if line.startswith("ExecStart=")).endswith(" $LOCKSTEP_ROBOT_OPTIONS")


def test_the_group_of_serial_ports_is_named_but_not_asked_for_since_a_missing_group_ends_the_unit() -> None:
    unit = next(unit for unit in UNITS if unit.name == "lockstep-robot.service")
    lines = unit.read_text().splitlines()
    assert "# SupplementaryGroups=dialout" in lines
    assert "SupplementaryGroups=video render" in lines
    assert "SupplementaryGroups=dialout" in (unit.parents[2] / "docs" / "deploy.md").read_text()


@pytest.mark.parametrize("drop_in", DROP_INS, ids=lambda path: path.name)
def test_systemd_accepts_the_unit_with_the_drop_in(drop_in: Path, tmp_path: Path) -> None:
    unit = next(unit for unit in UNITS if unit.name == drop_in.parent.name.removesuffix(".d"))
    program = str(Path(sys.executable).with_name("lockstep"))
    folder = tmp_path / drop_in.parent.name
    folder.mkdir()
    for here, text in ((tmp_path / unit.name, unit.read_text()), (folder / drop_in.name, drop_in.read_text())):
        here.write_text(re.sub(r"/opt/lockstep/\S+/bin/lockstep", program, text))
    done = subprocess.run(
        ["systemd-analyze", "verify", str(tmp_path / unit.name)], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_bridge_of_a_ros2_robot_runs_with_what_the_setup_file_sets_and_gets_each_word(tmp_path: Path) -> None:
    line = [line for line in ROS2.read_text().splitlines() if line.startswith("ExecStart=")][-1]
    words = shlex.split(line.removeprefix("ExecStart=").replace("$$", "$"))  # systemd.service(5): $$ is one $
    assert words.pop() == "$LOCKSTEP_ROBOT_OPTIONS"
    setup, program = tmp_path / "a folder" / "setup.bash", tmp_path / "lockstep"
    setup.parent.mkdir()
    setup.write_text("export OF_ROS=here\n")
    program.write_text('#!/bin/sh\necho "$$ $OF_ROS"; printf "%s\\n" "$@"\n')
    program.chmod(0o755)
    at = words.index("/opt/lockstep/bridge/bin/lockstep")
    words[at] = str(program)
    with subprocess.Popen(
        [*words, "--encode", "h264"],
        stdout=subprocess.PIPE,
        text=True,
        env={"LOCKSTEP_ROS_SETUP": str(setup), "PATH": "/usr/bin:/bin"},
    ) as process:
        out, _ = process.communicate(timeout=20)
    first, *given = out.splitlines()
    assert first == f"{process.pid} here", "exec: the main process, which systemd watches, is the bridge"
    assert given == [*words[at + 1 :], "--encode", "h264"]


def test_the_bridge_of_a_ros2_robot_is_started_as_the_unit_starts_one_but_for_its_robot() -> None:
    usual = next(unit for unit in UNITS if unit.name == "lockstep-robot.service").read_text()
    (line,) = re.findall("^ExecStart=(.+)$", usual, re.MULTILINE)
    (ros2,) = re.findall("^ExecStart=(.+)$", ROS2.read_text(), re.MULTILINE)
    options = line.partition("${LOCKSTEP_ROBOT_NAME} ")[2]
    assert ros2.endswith(f"/bin/lockstep robot --ros2 /etc/lockstep/robot.yaml {options}")
    assert "ExecStart=\n" in ROS2.read_text(), "an empty line takes the unit's own command away"


def test_each_robot_of_a_fleet_has_a_secret_that_root_alone_may_read(tmp_path: Path) -> None:
    """systemd.exec(5), LoadCredential=: a file of a folder is the credential ID_FILE."""
    lines = FLEET.read_text().splitlines()
    assert lines.index("LoadCredential=") < lines.index("LoadCredential=robots:/etc/lockstep/robots")
    assert "Environment=LOCKSTEP_LINK_SECRET_FILE=" in lines
    (guide,) = re.findall(
        r"```toml\n(# /etc/lockstep/console.toml, for a fleet with the unit.*?)```",
        (ROOT / "docs" / "deploy.md").read_text(),
        re.DOTALL,
    )
    for name in ("left", "right"):
        assert f'link_secret_file = "{CREDENTIALS}/robots_{name}.secret"' in guide
        (tmp_path / f"robots_{name}.secret").write_text(32 * name[0])
    path = tmp_path / "console.toml"
    path.write_text(guide.replace(CREDENTIALS, str(tmp_path)))
    found = robot_settings(Settings(config=path))
    assert {name: each.link_secret_file for name, each in found.items()} == {
        name: tmp_path / f"robots_{name}.secret" for name in ("left", "right")
    }


def test_the_guides_name_the_drop_ins() -> None:
    for drop_in, guide in ((FLEET, "deploy.md"), (ROS2, "ros2.md")):
        place = drop_in.relative_to(ROOT)
        text = (ROOT / "docs" / guide).read_text()
        assert f"{place} -t /etc/systemd/system/{place.parent.name}" in text
