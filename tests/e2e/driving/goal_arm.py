"""An arm with goal axes for tests: `lockstep up --robot tests.e2e.driving.goal_arm:GoalArm`.

Its joints are where their goals are, but for a shoulder that hangs below its goal, as a servo without an integral part
does.
Its pictures are those of the planar robot, which stands still.
"""

from collections.abc import Mapping, Sequence

import msgspec

from lockstep.protocol.actions import ParameterValue
from lockstep.protocol.description import Action, ActionParameter, Axis, Binding, ControlLayer, RobotDescription
from lockstep.robot_bridge.robots.actions import ActionDone, ActionRun
from lockstep.robot_bridge.robots.base import Measurement
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot

__all__ = ["GoalArm"]

SAG = 0.06  # rad
HELD = 0.7  # rad, further than the elbow's reach
START = (0.3, -0.9, 1.1, 0.2, -0.4, 0.03)


def _joint(name: str, label: str, minimum: float, maximum: float) -> Axis:
    return Axis(
        name=name,
        label=label,
        unit="rad",
        minimum=minimum,
        maximum=maximum,
        slew=1.2,
        brake=8.0,
        acceleration=5.0,
        kind="goal",
        reach=0.5,
    )


PAN = _joint("pan", "Shoulder pan", -1.92, 1.92)
LIFT = _joint("lift", "Shoulder lift", -1.75, 1.75)
ELBOW = _joint("elbow", "Elbow", -1.75, 1.57)
FLEX = _joint("flex", "Wrist flex", -1.66, 1.66)
ROLL = msgspec.structs.replace(_joint("roll", "Wrist roll", -3.15, 3.15), wrap=6.283185307179586)
JAW = msgspec.structs.replace(
    _joint("jaw", "Gripper", 0.0, 0.08), unit="m", slew=0.1, brake=0.5, acceleration=0.4, reach=0.03
)
AXES = (PAN, LIFT, ELBOW, FLEX, ROLL, JAW)
GRIP = Binding(axis="jaw", pad="triggers", touch="right_x", key_positive="KeyE", key_negative="KeyQ")
LAYERS = (
    ControlLayer(
        name="arm",
        label="Arm",
        bindings=(
            Binding(axis="pan", pad="left_x", touch="left_x", key_positive="KeyD", key_negative="KeyA"),
            Binding(
                axis="lift",
                pad="left_y",
                invert_pad=True,
                touch="left_y",
                key_positive="KeyW",
                key_negative="KeyS",
            ),
            Binding(
                axis="elbow",
                pad="right_y",
                invert_pad=True,
                touch="right_y",
                key_positive="ArrowUp",
                key_negative="ArrowDown",
            ),
            GRIP,
        ),
    ),
    ControlLayer(
        name="wrist",
        label="Wrist",
        bindings=(
            Binding(
                axis="flex",
                pad="left_y",
                invert_pad=True,
                touch="left_y",
                key_positive="KeyW",
                key_negative="KeyS",
            ),
            Binding(axis="roll", pad="left_x", touch="left_x", key_positive="KeyD", key_negative="KeyA"),
            GRIP,
        ),
    ),
)
HOLD = Action(
    name="hold",
    label="Hold elbow",
    moves=False,
    parameters=(ActionParameter(name="on", label="on", kind="switch", default=True),),
)


class GoalArm(PlanarRobot):
    """Six joints. The action `hold` keeps the elbow away from its goal, as a person who holds it does."""

    def __init__(self) -> None:
        super().__init__()
        self._goals = list(START)
        self._held_at: float | None = None  # rad, where the elbow is kept

    def describe(self) -> RobotDescription:
        return msgspec.structs.replace(
            DESCRIPTION,
            name="goal-arm",
            label="Arm",
            axes=AXES,
            layers=LAYERS,
            position_limits=(),
            planar_base=None,
            geofences=(),
            body_twists=(),
            actions=(HOLD,),
            map=None,
        )

    def apply(self, values: Sequence[float]) -> None:
        self._goals = list(values)

    def tick(self) -> None:
        pass

    def measured_axes(self) -> Sequence[float]:
        pan, lift, elbow, *others = self._goals
        return [pan, lift - SAG, elbow if self._held_at is None else self._held_at, *others]

    def measure(self) -> Measurement:
        return super().measure()._replace(axes=list(self.measured_axes()), at_rest=True)

    def rest_from_thread(self) -> None:
        pass

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        self._held_at = self._goals[2] - HELD if parameters["on"] is True else None
        return ActionDone("free" if self._held_at is None else "held")
