"""What `make test-fast` leaves out."""

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.needs import is_real


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("subprocess", True),
        ("lockstep.robot_bridge.bridge", True),
        ("robot_bridge.bridges", False),
        ("lockstep.robot_bridge.control.event_core", False),
        ("tests.support.stack", True),
    ],
)
def test_what_starts_something_is_known_by_its_name(name: str, expected: bool) -> None:
    assert is_real(name) is expected


@pytest.mark.parametrize(
    ("value", "source", "expected"),
    [
        (subprocess, "", True),
        (subprocess.run, "", True),
        (20.0, "asyncio.create_subprocess_exec", True),
        (json.loads, "json.loads", False),
        (20.0, "", False),
    ],
)
def test_a_file_of_tests_starts_what_its_helper_does(
    value: object, source: str, expected: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def made_up(name: str, source: str, value: object) -> ModuleType:
        module = ModuleType(name)
        path = tmp_path / f"{name}.py"
        path.write_text(source)
        vars(module).update(something=value, __file__=str(path))
        monkeypatch.setitem(sys.modules, name, module)
        return module

    is_real.cache_clear()
    made_up("tests.made_up", "", made_up("tests.made_up_helper", source, value))
    assert is_real("tests.made_up") is expected
