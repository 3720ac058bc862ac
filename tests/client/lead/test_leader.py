"""The process that reads a leader arm, here without LeRobot: tests/lerobot has the real one."""

import math
import sys
from pathlib import Path

import pytest

from lockstep.client.lead.leader import OLD, Leader, LeaderFailed, Newest


def test_an_action_is_known_until_it_is_old() -> None:
    newest = Newest(["pan", "lift"])
    assert newest.readings(0.0) == [None, None]
    newest.put({"pan": 1.0, "other": 2.0}, 5.0)
    assert newest.readings(5.0 + OLD) == [1.0, None]
    assert newest.readings(math.nextafter(5.0 + OLD, 6)) == [None, None]


async def test_a_python_without_lerobot_says_so() -> None:
    with pytest.raises(LeaderFailed, match="--lerobot-python"):
        async with Leader(sys.executable, ["--teleop.type=so101_leader"], 60.0):
            pass


async def test_a_python_that_is_not_there_says_so(tmp_path: Path) -> None:
    with pytest.raises(LeaderFailed, match="cannot be run"):
        async with Leader(str(tmp_path / "python"), [], 60.0):
            pass


async def test_a_process_that_says_something_else_is_no_leader() -> None:
    with pytest.raises(LeaderFailed):
        async with Leader("/bin/echo", [], 60.0):
            pass
