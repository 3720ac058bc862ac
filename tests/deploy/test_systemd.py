"""The systemd units, checked by systemd."""

import subprocess
import sys
from pathlib import Path

import pytest

from lockstep.robot_bridge.watchdog.liveness import ALARM, LIMIT

UNITS = sorted((Path(__file__).resolve().parents[2] / "deploy" / "systemd").glob("*.service"))


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
