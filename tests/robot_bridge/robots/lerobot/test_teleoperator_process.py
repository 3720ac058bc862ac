"""The arm that is nowhere, whose goals lead a robot of LeRobot."""

import pytest

from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.lerobot.settings import AxisSettings
from lockstep.robot_bridge.robots.lerobot.teleoperator_process import Open, arm_of
from lockstep.robot_bridge.yaml_file import SettingsPlace

DEGREES = AxisSettings(unit="deg", minimum=-90.0, maximum=90.0, slew=60.0, reach=30.0)
GRIPPER = AxisSettings(unit="%", minimum=10.0, maximum=100.0, slew=100.0, reach=100.0)


def test_it_begins_where_it_is_told_to_or_nearest_to_zero() -> None:
    arm = arm_of(Open(axes={"pan.pos": DEGREES, "gripper.pos": GRIPPER}, start={"pan.pos": -45.0}))
    assert arm.action == {"pan.pos": -45.0, "gripper.pos": 10.0}


def test_what_it_measures_is_what_its_description_has() -> None:
    arm = arm_of(Open(axes={"pan.pos": DEGREES}))
    description, measured = arm.describe(), arm.measure()
    check_description(description)
    assert len(measured.axes) == len(description.axes)
    assert len(measured.joints) == len(description.joints)


def test_its_action_is_what_was_applied_last_and_a_stop_keeps_it() -> None:
    arm = arm_of(Open(axes={"pan.pos": DEGREES}))
    arm.apply([12.5])
    assert arm.action == {"pan.pos": 12.5}
    assert arm.measured_axes() == [12.5]
    arm.stop()
    arm.apply([60.0])
    assert arm.action == {"pan.pos": 12.5}
    arm.reset()
    arm.apply([13.0])
    assert arm.action == {"pan.pos": 13.0}


@pytest.mark.parametrize("start", [{"tilt.pos": 0.0}, {"pan.pos": 91.0}])
def test_a_start_that_is_not_there_is_an_error(start: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="pos"):
        arm_of(Open(axes={"pan.pos": DEGREES}, start=start))


def test_an_axis_needs_its_unit_and_range() -> None:
    with pytest.raises(SettingsPlace):
        arm_of(Open(axes={"pan.pos": AxisSettings(unit="deg")}))
