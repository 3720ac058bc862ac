"""A bridge that hangs or was killed, and a real ROS 2 node that would drive on for ever: who says zero to it."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from lockstep.bench.harness.processes import Running, running_process
from lockstep.protocol.errors import LinkError
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.robot_bridge.bridge_helpers import Operator
from tests.support.ros2 import EXAMPLES, PATIENCE, STAY, RosRobot, have_ros, ros_python, running_ros_robot

pytestmark = [
    pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine"),
]

GO = [0.4, 0.3]

# `lockstep robot --ros2`, and one of its calls that hangs while the file `hang` is there.
A_BRIDGE = """
import ctypes, os, sys, time
hang, how, settings, state = sys.argv[1:5]
from lockstep.robot_bridge.robots.ros2 import robot
from lockstep.robot_bridge.robots.ros2.drives import base_drive

class Robot(robot.Ros2Robot):
    def __init__(self, *arguments):
        super().__init__(*arguments)
        if how == "tick":
            self.rest_call = ""  # the thread is alone

    def measure(self):
        if how == "tick" and os.path.exists(hang):
            time.sleep(60)
        if how == "interpreter" and os.path.exists(hang):
            ctypes.PyDLL(None).sleep(60)  # native code that keeps the interpreter's lock
        return super().measure()

class Drive(base_drive.BaseDrive):
    def _take(self, message):
        if how == "executor" and os.path.exists(hang):
            time.sleep(60)
        super()._take(message)

robot.Ros2Robot, robot.BaseDrive = Robot, Drive
sys.argv[1:] = ["--ros2", settings, "--port", "0", "--json", "--state-dir", state]
from lockstep.robot_bridge.cli import main
main()
"""


class RunningBridge:
    def __init__(self, process: Running, address: tuple[str, int]) -> None:
        self.process = process
        self.address = address


@asynccontextmanager
async def bridge_that_hangs(how: str, directory: Path, node: RosRobot) -> AsyncIterator[RunningBridge]:
    files = (str(EXAMPLES / "base.yaml"), str(directory / "bridge-state"))
    command = (ros_python(), "-c", A_BRIDGE, str(directory / "hang"), how, *files)
    async with running_process(*command, environment=node.environment) as (process, ready):
        host, _, port = ready["robot"].removeprefix("tcp://").rpartition(":")
        try:
            yield RunningBridge(process, (host, int(port)))
        finally:
            await process.kill()


async def drive(bridge: RunningBridge, before: Callable[[], None]) -> None:
    """Forward until cancelled or until the link ends; `before` each command."""
    with contextlib.suppress(LinkError, AssertionError, TimeoutError):
        async with RobotLink(*bridge.address, "operator", name="test") as link:
            driver = Operator(link)
            await driver.next(Feedback)
            async with asyncio.timeout(PATIENCE):
                await driver.heard(lambda feedback: feedback.faults == [] and feedback.unknown == [])
            await driver.arm()
            while True:
                before()
                await driver.drive(GO)


def ends_at_rest(twists: list[dict[str, Any]]) -> bool:
    return any(twist["values"] == GO for twist in twists) and twists[-1]["values"] == STAY


@pytest.mark.parametrize("how", ["tick", "executor", "interpreter", "frozen", "killed"])
async def test_a_base_that_is_driven_gets_a_zero_whatever_hangs(how: str, tmp_path: Path) -> None:
    """`tick`: by the thread; `executor`: by the tick, which misses odometry; the others: by the watchdog's process."""
    async with running_ros_robot(tmp_path) as node, bridge_that_hangs(how, tmp_path, node) as bridge:
        hung = asyncio.Event()

        def hangs_once_it_moves() -> None:
            if not hung.is_set() and any(note["values"] == GO for note in node.notes("twist")):
                (tmp_path / "hang").touch()
                hung.set()

        driving = asyncio.create_task(drive(bridge, hangs_once_it_moves))
        try:
            async with asyncio.timeout(2 * PATIENCE):
                await hung.wait()
            if how == "frozen":
                bridge.process.pause()
            elif how == "killed":
                await bridge.process.kill()
            twists = await node.noted("twist", ends_at_rest)
            for _ in range(10):
                await node.tell("tick")
        finally:
            driving.cancel()
            await asyncio.wait([driving])
        assert [note["values"] for note in node.notes("twist")][len(twists) - 1 :].count(GO) == 0, "it drives on"
