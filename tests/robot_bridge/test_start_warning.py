"""A lamp that is lit before the first motion, over a real bridge."""

import msgspec
import pytest

from lockstep.protocol.description import Axis, RobotDescription, StartWarning
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from tests.robot_bridge.bridge_helpers import DRIVE, RecordingRobot, operator, running_bridge

LAMP = Axis(name="lamp", label="Lamp", unit="", minimum=0, maximum=1, slew=1000, brake=1000)


def warning_robot(**changes: object) -> RobotDescription:
    warning = StartWarning(**{"seconds": 0.5, "axis": "lamp", "value": 1.0} | changes)  # type: ignore[arg-type]
    return msgspec.structs.replace(DESCRIPTION, axes=(*DESCRIPTION.axes, LAMP), start_warning=warning)


class LampRobot(RecordingRobot):
    def describe(self) -> RobotDescription:
        return warning_robot()

    def apply(self, values: list[float]) -> None:  # type: ignore[override]
        super().apply(values[:-1])
        when, _ = self.applied.pop()
        self.applied.append((when, list(values)))

    def measure(self):  # type: ignore[no-untyped-def]
        measured = super().measure()
        return measured._replace(axes=[*measured.axes, 0.0])


async def test_the_lamp_is_lit_for_its_seconds_and_only_then_the_robot_moves() -> None:
    robot = LampRobot()
    async with running_bridge(robot) as bridge, operator(bridge, armed=False) as driver:
        assert (await driver.refused(driver.command([*DRIVE, 0.0]))).reason == "not_neutral"
        assert all(values[-1] == 0 for _, values in robot.applied)
        feedback = await driver.drive([0.0, 0.0, 0.0, 0.0])
        assert not feedback.neutral_needed
        assert 0 < feedback.warning <= 0.5
        assert (await driver.refused(driver.command([*DRIVE, 0.0]))).reason == "warning"
        assert robot.applied[-1][1] == [0.0, 0.0, 0.0, 1.0]
        while driver.feedback.warning:
            await driver.drive([0.0, 0.0, 0.0, 0.0])
        await driver.drive([*DRIVE, 0.0])
        assert robot.applied[-1][1][0] > 0
        assert robot.applied[-1][1][-1] == 0


async def test_a_command_for_the_lamp_alone_is_neutral() -> None:
    async with running_bridge(LampRobot()) as bridge, operator(bridge, armed=False) as driver:
        assert not (await driver.drive([0.0, 0.0, 0.0, 1.0])).neutral_needed


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seconds": 0.0}, "seconds"),
        ({"seconds": 31.0}, "seconds"),
        ({"seconds": float("nan")}, "seconds"),
        ({"axis": "horn"}, "'horn', which is not described"),
        ({"value": 0.0}, "not its rest value"),
        ({"value": 2.0}, "one of axis lamp"),
        ({"axis": DESCRIPTION.axes[0].name, "value": 0.1}, "moves the robot"),
    ],
)
def test_a_warning_that_cannot_be_given_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(DescriptionError, match=message):
        check_description(warning_robot(**changes))
    check_description(warning_robot())
