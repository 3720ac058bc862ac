"""A tool among the axes of a robot: which of the values are its joints' and its pose's, and what drives them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import Pose
from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.pose_solver import PoseSolver
from lockstep.robot_bridge.kinematics.rotations import rotation_vector
from lockstep.robot_bridge.robots.so101.arm_drive import SETTLES, ArmDrive
from lockstep.robot_bridge.robots.tool_pose.axes import ToolAxes

__all__ = ["PosedTool", "ToolPlace", "tool_pose"]

Array = npt.NDArray[np.float64]


class ToolPlace(NamedTuple):
    """The numbers of axes in the robot's description."""

    joints: tuple[int, ...]  # goal axes, from the base to the tool
    pose: tuple[int, ...]  # x, y, z, rx, ry, rz


def tool_pose(name: str, label: str, body: str, axes: ToolAxes, joints: Sequence[str], frame: str = "") -> Pose:
    """Return the pose for the description.

    `joints`: the goal axes of the joints. `frame`: a body or camera; "": the world.
    """
    x, y, z, rx, ry, rz = axes.names
    return Pose(
        name=name,
        label=label,
        body=body,
        frame=frame,
        position=(x, y, z),
        rotation=(rx, ry, rz),
        instead_of=tuple(joints),
        settling=SETTLES,
    )


class PosedTool:
    """Keeps the goals of the joints of one arm, which its own axes or the tool's pose drive.

    The joints' rates are bounded, whatever is applied. Call `drive` in every tick in which the robot may move.

    Attributes:
        name: of the pose
        place: of its values among those of the robot
    """

    def __init__(
        self,
        name: str,
        place: ToolPlace,
        chain: Chain,
        solver: PoseSolver,
        rates: Sequence[float],
        posture: Sequence[float],
    ) -> None:
        """`rates`: rad/s or m/s, of the joints at most. `posture`: rad or m, where they are."""
        self.name = name
        self.place = place
        self._chain = chain
        self._drive = ArmDrive(chain, solver, rates, posture)

    @property
    def goals(self) -> tuple[float, ...]:
        """The joints' goals now, rad or m."""
        return self._drive.goals

    @property
    def faults(self) -> list[str]:
        return self._drive.faults

    def drive(
        self,
        values: Sequence[float],
        seconds: float,
        since: float,
        measured: Sequence[float] | None = None,
        *,
        pursues: bool = False,
    ) -> Array:
        """Take the values of all axes of the robot; return the rates of this arm's joints for the coming `seconds`.

        `since`: s since the call before. `measured`: rad or m, where the joints are. `pursues`: a command drives the
        tool, also where its goal stands still.
        """
        own = [values[number] for number in (*self.place.joints, *self.place.pose)]
        return self._drive.drive(own, seconds, since, measured, pursues=pursues)

    def prepare(self) -> None:
        """Compute what the next `drive` needs of the joints alone."""
        self._drive.prepare()

    def hold(self, posture: Sequence[float] | None = None) -> None:
        """Stay where the goals are, or in a posture, until the values change."""
        self._drive.hold(posture)

    def restart(self, posture: Sequence[float] | None = None) -> None:
        """Stay where the goals are, or in a posture, whatever the next values are."""
        if posture is not None:
            self._drive.hold(posture)
        self._drive.restart()

    def put_pursued(self, goals: list[float]) -> None:
        """Put the joints' goals, and the pose of the tool at them, among the goals of all axes of the robot."""
        for number, goal in zip((*self.place.joints, *self.place.pose), self._drive.pursued(), strict=True):
            goals[number] = goal

    def pose_at(self, joints: Sequence[float]) -> list[float]:
        """Return the six values of the pose where the joints are at these positions."""
        state = self._chain.at(joints)
        return [*state.position.tolist(), *rotation_vector(state.rotation).tolist()]
