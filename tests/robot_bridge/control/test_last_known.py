"""Numbers that are not known never leave the bridge."""

import math

from lockstep.robot_bridge.control.last_known import LastKnown
from lockstep.robot_bridge.robots.base import Measurement
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from tests.robot_bridge.bridge_helpers import operator, running_bridge

NAN = math.nan


def measured(axes: list[float], joints: list[float], wrench: list[float], ranges: list[float]) -> Measurement:
    return Measurement(axes=axes, joints=joints, wrench=wrench, ranges=ranges, at_rest=True, faults=[])


def test_what_is_known_passes_unchanged() -> None:
    whole = measured([0.1, 0.2, 0.3], [1.0, 2.0, 3.0], [1.0] * 6, [4.0, 5.0])
    assert LastKnown(DESCRIPTION).settle(whole) == (whole, [])


def test_an_unknown_value_is_named_and_keeps_the_last_known_one() -> None:
    known = LastKnown(DESCRIPTION)
    known.settle(measured([0.1, 0.2, 0.3], [1.0, 2.0, 3.0], [], []))
    settled, unknown = known.settle(measured([NAN, 0.0, math.inf], [NAN, 4.0, 5.0], [], []))
    assert settled.axes == [0.1, 0.0, 0.3]
    assert settled.joints == [1.0, 4.0, 5.0]
    assert unknown == ["base.vx", "base.wz", "base.x"]


def test_a_sensor_with_one_unknown_value_is_left_out() -> None:
    settled, unknown = LastKnown(DESCRIPTION).settle(measured([0.0] * 3, [0.0] * 3, [NAN] + [0.0] * 5, [1.0, NAN]))
    assert settled.wrench == []
    assert settled.ranges == []
    assert unknown == []


async def test_the_feedback_names_what_the_robot_cannot_measure() -> None:
    class Blind(PlanarRobot):
        def measure(self) -> Measurement:
            return super().measure()._replace(joints=[NAN, 1.0, 2.0])

    async with running_bridge(Blind()) as bridge, operator(bridge) as driver:
        assert driver.feedback.unknown == ["base.x"]
        assert driver.feedback.joints == [0.0, 1.0, 2.0]
