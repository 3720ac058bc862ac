"""docs/tutorials/ros2.md, with a real node and a real bridge in ROS' own Python.

What installs ROS is not run: `make` has installed the same lock file in .ros2/, and the bridge's sources are on its
path instead of in it.
"""

import asyncio
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from lockstep.client import Console
from lockstep.robot_bridge.robots.ros2 import read_settings
from tests.docs.tutorials.reader import Reader
from tests.support.ros2 import PATIENCE, have_ros, ros_environment, ros_python

pytestmark = pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine")


@pytest.fixture
def reader(tmp_path: Path) -> Reader:
    (tmp_path / "rosenv").symlink_to(Path(ros_python()).parents[1])
    return Reader("ros2", tmp_path, **ros_environment())


async def _until(console: Console, condition: Callable[[list[str]], bool]) -> list[str]:
    """The robot's faults, once they meet the condition."""
    async with asyncio.timeout(PATIENCE):
        async for feedback in console.feedbacks():
            if condition(feedback.faults):
                return feedback.faults
    raise AssertionError("the feedback ended")


async def test_a_reader_drives_the_base_and_sees_its_topics_fall_silent(reader: Reader) -> None:
    reader.take("python3 -m venv rosenv")
    node = reader.take("rosenv/bin/python docs/examples/ros2/turtlebot.py")
    console = reader.take("source .venv/bin/activate\nlockstep up")
    ports = f"--port {reader.port('8000')} --robot-port {reader.port('5600')}"
    async with reader.process(f"{console} {ports}", "Ctrl-C") as printed:
        (link,) = re.findall(r"To drive, open: +(\S+)", printed)
        async with Console(link, name="watches") as watching:
            reader.values = {r"LINK='[^']*'": f"LINK='{link}'"}
            drive = reader.take("source .venv/bin/activate\nLINK=")
            async with reader.process(f"{node} & echo started; wait", "started"):
                await _until(watching, lambda faults: faults == [])
                said = await reader.type(drive)
            reader.compare(said)
            assert float(re.findall(r"x ([\d.]+) m", said)[0]) > 0.2
            reader.compare("\n".join(await _until(watching, lambda faults: len(faults) == 4)))


async def test_a_reader_has_the_file_of_the_running_robot_written(reader: Reader) -> None:
    reader.take("python3 -m venv rosenv")
    node = reader.take("rosenv/bin/python docs/examples/ros2/turtlebot.py")
    reader.take("source .venv/bin/activate\nlockstep up")
    reader.take("source .venv/bin/activate\nLINK=")
    async with reader.process(f"{node} & echo started; wait", "started"):
        said = await reader.run("source .venv/bin/activate\nlockstep ros2 discover")
    reader.compare(said)
    settings, _ = read_settings(reader.folder / "mine.yaml")
    assert settings.base is not None
    assert settings.base.command.topic == "/cmd_vel"
    assert [camera.name for camera in settings.cameras] == ["camera"]


@pytest.mark.long
@pytest.mark.timeout(500)
async def test_the_bridge_alone_passes_the_check(reader: Reader) -> None:
    reader.take("python3 -m venv rosenv")
    node = reader.take("rosenv/bin/python docs/examples/ros2/turtlebot.py")
    reader.take("source .venv/bin/activate\nlockstep up")
    reader.take("source .venv/bin/activate\nLINK=")
    reader.take("source .venv/bin/activate\nlockstep ros2 discover")
    bridge = reader.take("rosenv/bin/python -m lockstep.robot_bridge") + f" --port {reader.port('5600')}"
    async with reader.process(f"{node} & echo started; wait", "started"), reader.process(bridge, "tcp://"):
        assert "40 ok, 20 not applicable" in await reader.run("lockstep check")
    assert reader.left == []
