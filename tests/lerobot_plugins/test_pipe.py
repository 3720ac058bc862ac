"""The plugins' end of the pipe, without LeRobot: a script is the process at the other end."""

import importlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

PLUGIN = Path(__file__).parents[2] / "lerobot_plugins" / "lerobot_robot_lockstep" / "lerobot_robot_lockstep"
BEGIN = """
import json, sys
def read():
    size = int.from_bytes(sys.stdin.buffer.read(4), "big")
    return json.loads(sys.stdin.buffer.read(size))
def say(**said):
    text = json.dumps(said).encode()
    sys.stdout.buffer.write(len(text).to_bytes(4, "big") + text)
    sys.stdout.buffer.flush()
"""


class NotConnected(ConnectionError):
    pass


@pytest.fixture
def pipe(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The module, of a package whose beginning would ask for LeRobot."""
    for name in ("lerobot", "lerobot.utils", "lerobot.utils.errors", "lerobot_robot_lockstep"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    sys.modules["lerobot.utils.errors"].DeviceNotConnectedError = NotConnected  # type: ignore[attr-defined]
    sys.modules["lerobot_robot_lockstep"].__path__ = [str(PLUGIN)]
    loaded = importlib.import_module("lerobot_robot_lockstep.pipe")
    monkeypatch.setattr(loaded, "MARGIN", 1.0)
    yield loaded
    for name in ("lerobot_robot_lockstep.pipe", "lerobot_robot_lockstep.errors"):
        sys.modules.pop(name, None)


@pytest.fixture
def opened(pipe: ModuleType, tmp_path: Path) -> Iterator[Callable[[str], Any]]:
    made: list[Any] = []

    def open_(script: str) -> Any:
        program, python = tmp_path / "other_side.py", tmp_path / "python"
        program.write_text(BEGIN + script)
        python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{program}" "$@"\n')
        python.chmod(0o700)
        made.append(pipe.Pipe(str(python), "module"))
        return made[-1]

    yield open_
    for each in made:
        each.close()


def test_a_request_has_its_answer_and_the_bytes_behind_it(opened: Callable[[str], Any]) -> None:
    pipe = opened(
        "while True:\n    said = read()\n    say(do=said['do'], sizes=[3, 0])\n"
        "    sys.stdout.buffer.write(b'abc'); sys.stdout.buffer.flush()"
    )
    for do in ("observe", "drive"):
        assert pipe.ask(do, 20.0) == ({"do": do}, [b"abc", b""])
    assert pipe.alive


def test_an_answer_that_comes_too_late_is_not_taken_for_that_of_the_next_request(opened: Callable[[str], Any]) -> None:
    """An observation of before would stand beside a new action."""
    pipe = opened("first = read()\nsecond = read()\nsay(of=first['number'])\nsay(of=second['number'])\nread()")
    with pytest.raises(ConnectionError, match="does not answer"):
        pipe.ask("observe", number=1)
    with pytest.raises(ConnectionError, match="an earlier request had no answer"):
        pipe.ask("observe", 20.0, number=2)
    assert not pipe.alive


def test_a_process_that_did_not_answer_hears_the_end_though_nobody_closes_it(
    opened: Callable[[str], Any], tmp_path: Path
) -> None:
    """It brings the robot to rest then, and gives the seat back."""
    heard = tmp_path / "heard"
    pipe = opened(f"read()\nsys.stdin.buffer.read()\nopen({str(heard)!r}, 'w').close()")
    with pytest.raises(ConnectionError, match="does not answer"):
        pipe.ask("observe")
    deadline = time.monotonic() + 20
    while not heard.exists():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.parametrize(
    "script",
    [
        "sys.stdout.write('Traceback (most recent call last)'); sys.stdout.flush(); read()",
        "sys.stdout.buffer.write(b'\\0\\0\\0\\1{'); sys.stdout.flush(); read()",
        "sys.stdout.buffer.write(b'\\0\\0\\0\\2[]'); sys.stdout.flush(); read()",
        "say(sizes=[-1]); read()",
        "say(sizes=[1 << 40]); read()",
        "say(sizes=['x']); read()",
        "say(sizes=[8])",
        "",
    ],
)
def test_what_is_no_answer_ends_the_connection_by_name(opened: Callable[[str], Any], script: str) -> None:
    pipe = opened(f"read()\n{script}")
    with pytest.raises(ConnectionError, match="Lockstep's process"):
        pipe.ask("observe", 20.0)
    assert not pipe.alive


def test_a_no_is_an_answer(opened: Callable[[str], Any]) -> None:
    pipe = opened("read()\nsay(error='Refused', reason='stopped', text='no')\nread()\nsay(well=True)\nread()")
    with pytest.raises(Exception, match="Refused: no"):
        pipe.ask("drive", 20.0)
    assert pipe.ask("drive", 20.0) == ({"well": True}, [])


def test_the_process_is_told_whose_end_is_its_own(opened: Callable[[str], Any]) -> None:
    assert opened("read()\nsay(arguments=sys.argv[1:])\nread()").ask("open", 20.0) == (
        {"arguments": ["-I", "-m", "module", str(os.getpid())]},
        [],
    )
