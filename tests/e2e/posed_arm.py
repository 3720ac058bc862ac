"""A mobile robot with a tool for tests: `lockstep up --robot tests.e2e.posed_arm:PosedArm`.

Its base is the planar robot's. The tool's pose and its jaw are goal axes, and are where their goals are; a joint moves
what the pose moves too. Its two cameras are a stereo pair.
"""

from collections.abc import Sequence

import msgspec

from lockstep.protocol.description import Axis, Binding, ControlLayer, Pose, RobotDescription
from lockstep.robot_bridge.robots.base import Measurement, MediaSource
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION, FRONT
from lockstep.robot_bridge.robots.planar.drawing import FrontDrawing, OverviewDrawing
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot

__all__ = ["START", "TOOL", "CameraPosedArm", "PosedArm"]


def _goal(name: str, label: str, unit: str, bound: float) -> Axis:
    return Axis(
        name=name,
        label=label,
        unit=unit,
        minimum=-bound,
        maximum=bound,
        slew=2.0,
        brake=10.0,
        acceleration=10.0,
        kind="goal",
        reach=0.6,
    )


TOOL = tuple(_goal(f"tool.{axis}", f"Tool {axis}", "m", 2.0) for axis in "xyz") + tuple(
    _goal(f"tool.r{axis}", f"Tool turn {axis}", "rad", 3.1) for axis in "xyz"
)
JAW = msgspec.structs.replace(_goal("jaw", "Jaw", "m", 0.1), slew=0.1, brake=0.5, acceleration=0.5, reach=0.05)
PAN = _goal("pan", "Pan", "rad", 2.0)
START = (0.4, 0.1, 0.3, 0.0, 0.0, 0.5, 0.0, 0.2)  # of the tool, the jaw and the joint
EYES = tuple(
    msgspec.structs.replace(FRONT, name=f"eyes.{side}", label=f"Eyes {side}", frame_rate=15.0)
    for side in ("left", "right")
)


class PosedArm(PlanarRobot):
    """Eleven axes: three of the base, six of the tool, the jaw, and the joint that the tool stands for."""

    def __init__(self) -> None:
        super().__init__()
        self._goals = list(START)
        left, right = EYES
        self._eyes: tuple[MediaSource, ...] = (
            CameraSource(left, OverviewDrawing(left.width, left.height).draw, lambda: self._state),
            CameraSource(right, FrontDrawing(right.width, right.height).draw, lambda: self._state),
        )

    def describe(self) -> RobotDescription:
        (drive,) = DESCRIPTION.layers[:1]
        grip = Binding(axis="jaw", pad="triggers")
        turn = Binding(axis="pan", pad="right_y", key_positive="KeyP")
        return msgspec.structs.replace(
            DESCRIPTION,
            name="posed-arm",
            label="Arm with a pose",
            axes=(*DESCRIPTION.axes, *TOOL, JAW, PAN),
            layers=(ControlLayer(name="drive", label="Drive", bindings=(*drive.bindings, grip, turn)),),
            cameras=EYES,
            microphones=(),
            actions=(),
            map=None,
            poses=(
                Pose(
                    name="tool",
                    label="Tool",
                    body="base",
                    position=("tool.x", "tool.y", "tool.z"),
                    rotation=("tool.rx", "tool.ry", "tool.rz"),
                    instead_of=("pan",),
                ),
            ),
        )

    def apply(self, values: Sequence[float]) -> None:
        super().apply(values[:3])
        self._goals = list(values[3:])

    def measure(self) -> Measurement:
        found = super().measure()
        return found._replace(axes=[*found.axes, *self._goals])

    def sources(self) -> Sequence[MediaSource]:
        return self._eyes


class CameraPosedArm(PosedArm):
    """The same with the tool's pose in the frame of a camera: right, down and away in its picture."""

    def describe(self) -> RobotDescription:
        description = super().describe()
        (pose,) = description.poses
        return msgspec.structs.replace(description, poses=(msgspec.structs.replace(pose, frame=EYES[0].name),))
