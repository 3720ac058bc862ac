"""An arm of the tests behind LeRobot's classes, with its bridge in LeRobot's Python and a console beside it."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.lerobot.commands import PATIENCE, Arm, environment, lerobot_python
from tests.support.stack import running_stack

SETTINGS = """
robot: tests.lerobot.parts.tiny_arm:TinyArm
config: {id: desk, disable_torque_on_disconnect: true}
"""


@asynccontextmanager
async def running_arm(directory: Path, settings: str = SETTINGS) -> AsyncIterator[Arm]:
    """`lockstep up --lerobot`, as its user runs it."""
    file = directory / "arm.yaml"
    file.write_text(settings)
    extra = ("--lerobot", str(file), "--robot-python", lerobot_python())
    settings_of_all = environment(directory)
    async with running_stack(directory, extra=extra, settings=settings_of_all, ready_seconds=PATIENCE) as stack:
        yield Arm(stack, directory)


@pytest.fixture
async def arm(tmp_path: Path) -> AsyncIterator[Arm]:
    async with running_arm(tmp_path) as found:
        yield found
