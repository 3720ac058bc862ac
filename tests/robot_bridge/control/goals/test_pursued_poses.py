"""The bridge tells a robot before each `apply` which poses to pursue, over real TCP."""

from collections.abc import Callable, Sequence

import msgspec
import pytest

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Rest, Stop
from lockstep.robot_bridge.control.coming_to_rest import REPEATS, ComingToRest
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.errors import RobotFailed
from tests.robot_bridge.bridge_helpers import Operator, operator, raw_link, running_bridge
from tests.robot_bridge.control.goals.goal_helpers import ARM_AXES, HangingArm

PURSUED, NOT = ("tool",), ()
X_STAYS: list[float | None] = [0.0, None, None, None, 0.6, None]  # a command that moves, to where the tool is


class LaggingArm(HangingArm):
    """Its tool may come nearer to its goals after they stood still. It notes what it was told to pursue."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[tuple[str, ...]] = []  # since the last `apply`
        self.pursuits: list[tuple[str, ...]] = []  # at each `apply`
        self.fails = False

    def describe(self) -> RobotDescription:
        description = super().describe()
        poses = tuple(msgspec.structs.replace(pose, settling=0.12) for pose in description.poses)
        return msgspec.structs.replace(description, poses=poses)

    def pursue_poses(self, names: Sequence[str]) -> None:
        self.told.append(tuple(names))

    def apply(self, values: Sequence[float]) -> None:
        [names] = self.told
        self.told.clear()
        self.pursuits.append(names)
        super().apply(values)

    def tick(self) -> None:
        if self.fails:
            raise OSError("no answer")

    async def pursues(self, names: tuple[str, ...]) -> None:
        await self.until(lambda: self.pursuits[-1:] == [names], f"it is told {names}")


async def _drive(driver: Operator, robot: LaggingArm) -> None:
    """Repeat a goal until the pursuit was told; the last command is executed."""
    await driver.drive(X_STAYS)
    await robot.pursues(PURSUED)


async def test_a_command_that_repeats_a_goal_is_a_pursuit_and_silence_ends_it() -> None:
    robot = LaggingArm()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        assert set(robot.pursuits) == {NOT}
        await _drive(driver, robot)
        await robot.pursues(NOT)
        ended = len(robot.pursuits)
        await driver.heard(lambda feedback: feedback.at_rest)
        assert set(robot.pursuits[ended:]) == {NOT}
        await _drive(driver, robot)


async def test_rest_a_stop_and_a_lost_link_end_the_pursuit_until_a_new_command() -> None:
    robot = LaggingArm()
    async with running_bridge(robot) as bridge:
        async with operator(bridge) as driver, raw_link(bridge, "events") as watcher:
            for ends in ("rest", "stop"):
                await _drive(driver, robot)
                if ends == "rest":
                    driver.link.send(Rest(event=driver.feedback.event))
                else:
                    watcher.send(Stop(by="guard"))
                await robot.pursues(NOT)
            await driver.heard(lambda feedback: feedback.stop.stopped)
            await driver.reset()
            await driver.arm()
            await _drive(driver, robot)
        await robot.pursues(NOT)


async def test_a_bridge_that_ends_because_the_robot_failed_ends_the_pursuit_first() -> None:
    robot = LaggingArm()
    async with running_bridge(robot) as bridge:
        async with operator(bridge) as driver:
            await _drive(driver, robot)
            before = len(robot.pursuits)
            robot.fails = True
        with pytest.raises(RobotFailed, match="OSError: no answer"):
            await bridge.wait()
    assert set(robot.pursuits[before + 1 :]) == {NOT}  # the tick that fails was told before it


@pytest.mark.parametrize("end", [ComingToRest.step, ComingToRest.at_once])
def test_a_robot_that_cannot_be_told_gets_its_rest_values_all_the_same(end: Callable[..., object]) -> None:
    class Deaf(HangingArm):
        def pursue_poses(self, names: Sequence[str]) -> None:
            raise OSError("no answer")

    robot = Deaf()
    shaper = AxisShaper(ARM_AXES, hold=0.3)
    shaper.begin(robot.measured_axes(), robot.goals())
    leaving = ComingToRest(robot, shaper, 0.3, 0.0)
    for _ in range(REPEATS):
        end(leaving, 0.0) if end is ComingToRest.step else end(leaving)
    assert robot.applied
    assert not leaving.rests  # it may still pursue a goal: the bridge goes on trying, then calls `stop`
