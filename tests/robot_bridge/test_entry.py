"""The command `lockstep`."""

import gc
import importlib.util
import subprocess
import sys

import pytest

from lockstep.robot_bridge import commands
from lockstep.robot_bridge.entry import main
from lockstep.server.cli import main as console_commands


def test_garbage_is_collected_while_the_command_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    collected: list[bool] = []
    monkeypatch.setattr(console_commands, "main", lambda: collected.append(gc.isenabled()))
    main()
    assert collected == [True]


def test_a_robot_without_a_console_has_the_commands_of_a_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[str] = []
    monkeypatch.setattr(commands, "main", lambda: ran.append("of a robot"))
    monkeypatch.setattr(console_commands, "main", lambda: ran.append("of a console"))
    monkeypatch.setattr("lockstep.robot_bridge.entry.find_spec", lambda name: None)
    main()
    assert importlib.util.find_spec("lockstep.server") is not None
    assert ran == ["of a robot"]


def test_a_robots_commands_need_nothing_that_only_some_robots_need() -> None:
    some = "{'numpy', 'yaml', 'mujoco', 'av'}"
    look = f"import sys, lockstep.robot_bridge.commands; print(sorted({some} & set(sys.modules)))"
    done = subprocess.run((sys.executable, "-c", look), capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "[]\n"
