"""Half a minute of the soak with one observer, as its user runs it; longer ones with more in `make test-long`."""

import asyncio
import json
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.browser, pytest.mark.timeout(600)]


@pytest.mark.parametrize(
    ("minutes", "seed", "observers"),
    [
        ("0.5", "8", "1"),  # a plan with time to drive before the first trouble and after the last
        pytest.param("1", "1", "2", marks=pytest.mark.long),
        pytest.param("5", "1", "20", marks=pytest.mark.long),
    ],
)
async def test_minutes_of_trouble_break_no_promise(minutes: str, seed: str, observers: str) -> None:
    command = (
        *(str(Path(sys.executable).with_name("lockstep")), "soak"),
        *("--minutes", minutes, "--seed", seed, "--observers", observers, "--json", "-"),
    )
    process = await asyncio.create_subprocess_exec(
        *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    out, said = await process.communicate()
    assert process.returncode == 0, said.decode()[-3000:]
    verdict = json.loads(out)
    broken = ("executed_twice", "executed_late", "moved_without_seat", "moved_while_stopped", "reloads_needed")
    assert {name: verdict[name] for name in broken} == dict.fromkeys(broken, 0)
    assert verdict["violations"] == 0
    if float(minutes) >= 1:  # a shorter life of the server is too short to judge its memory
        assert isinstance(verdict["memory_growth"], float)
    assert verdict["executed"] > 20, "the operator drove"
    assert verdict["epochs"] == 2, "the bridge was killed and came back"
    assert verdict["refused"]["no_seat"] > 0, "the intruders tried"
