"""The description's limits hold with real physics: slip, servo lag and all. In simulated time, as the bridge ticks."""

import math

import msgspec
import pytest

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.limits.motion_limits import MotionLimits
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator


class Limited:
    """The robot behind the bridge's shaper and limits."""

    def __init__(self, robot: MobileManipulator, description: RobotDescription | None = None) -> None:
        self.robot = robot
        description = description or robot.describe()
        check_description(description)
        self.joints = [joint.name for joint in description.joints]
        self.names = [axis.name for axis in description.axes]
        self.limits = MotionLimits(description, robot, robot.tick_seconds)
        self.shaper = AxisShaper(description.axes, hold=0.3, limiter=self.limits)
        self.now = 0.0

    def drive(self, seconds: float, **axes: float) -> float:
        """Command this all the time; the furthest that x came."""
        values = [axes.get(name.replace(".", "_"), 0.0) for name in self.names]
        reached = -math.inf
        for _ in range(round(seconds / self.robot.tick_seconds)):
            self.shaper.drive(values, self.now)
            self.robot.apply(self.shaper.step(self.now, self.robot.tick_seconds))
            self.robot.tick()
            self.now += self.robot.tick_seconds
            reached = max(reached, self.joint("base.x"))
        return reached

    def joint(self, name: str) -> float:
        return self.robot.positions()[self.joints.index(name)]


def test_the_description_has_a_limit_for_every_joint_of_the_arm_and_two_fences(robot: MobileManipulator) -> None:
    description = robot.describe()
    check_description(description)
    assert [limit.joint for limit in description.position_limits] == [joint.name for joint in description.joints[3:]]
    assert [fence.name for fence in description.geofences] == ["room", "charger"]


@pytest.mark.parametrize("turn", [0.0, 1.2])
def test_at_full_speed_the_base_stops_before_a_forbidden_zone(robot: MobileManipulator, turn: float) -> None:
    description = robot.describe()
    zone = msgspec.structs.replace(description.geofences[1], polygon=((0.9, -2.0), (1.2, -2.0), (1.2, 2.0), (0.9, 2.0)))
    limited = Limited(robot, msgspec.structs.replace(description, geofences=(zone,)))
    reached = limited.drive(3.0, base_vx=0.6, base_vy=0.5, base_wz=turn)
    assert reached > 0.3 if turn == 0.0 else reached > 0.1
    assert reached + 0.31 <= 0.9
    if turn == 0.0:
        assert reached + 0.31 > 0.8  # and not much earlier


def test_the_arm_stops_at_a_tighter_limit_and_turns_back_freely(robot: MobileManipulator) -> None:
    description = robot.describe()
    waist = msgspec.structs.replace(description.position_limits[0], minimum=-0.5, maximum=0.5)
    limited = Limited(robot, msgspec.structs.replace(description, position_limits=(waist,)))
    limited.drive(4.0, tool_vy=0.25)
    assert 0.4 < limited.joint("arm.waist") <= 0.5
    assert limited.limits.acting == {"arm.waist"}
    limited.drive(2.0, tool_vy=-0.25)
    assert limited.joint("arm.waist") < 0.4
    assert limited.limits.acting == frozenset()


def test_in_the_middle_of_their_ranges_the_limits_change_nothing(robot: MobileManipulator) -> None:
    limited = Limited(robot)
    limited.drive(0.5, base_vx=0.3, tool_vz=0.1)
    assert limited.limits.acting == frozenset()
    assert limited.shaper.values[0] == pytest.approx(0.3)
