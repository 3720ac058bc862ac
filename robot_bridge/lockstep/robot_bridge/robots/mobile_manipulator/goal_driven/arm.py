"""Drives the arm to goals of its joints, or its tool to a pose."""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.kinematics.body_capsules import body_capsules
from lockstep.robot_bridge.kinematics.capsules import separate_pairs
from lockstep.robot_bridge.kinematics.clearance import Clearance
from lockstep.robot_bridge.kinematics.pose_solver import JointBounds
from lockstep.robot_bridge.robots.actions import ActionRun
from lockstep.robot_bridge.robots.go_to import GoTo
from lockstep.robot_bridge.robots.mobile_manipulator.goal_driven.description import RATES, arm_chain, describe_arm
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import ARM, BASE, Simulation
from lockstep.robot_bridge.robots.tool_pose.arm_solver import tool_solver
from lockstep.robot_bridge.robots.tool_pose.posed_tool import PosedTool, ToolPlace

__all__ = ["GoalArm"]

Array = npt.NDArray[np.float64]
COUNT: Final = len(RATES)
LEAD: Final = (0.065, 0.065, 0.065, 0.08, 0.08, 0.08)  # rad; with the servos' stiffness, this is the largest push


class GoalArm:
    """Its values are those of the arm's axes: six joints, then the tool's pose against the mount.

    No servo aims further than LEAD ahead of its joint, which bounds the push of an arm that is blocked.
    """

    def __init__(
        self, simulation: Simulation, description: RobotDescription, *, now: Callable[[], float] = clock.now
    ) -> None:
        self._joints = simulation.joints[ARM]  # a view
        self._all_joints = simulation.joints
        self._aims: Array = simulation.data.ctrl[ARM]  # a view
        model = simulation.model
        self._lags = -model.actuator_biasprm[ARM, 2] / model.actuator_gainprm[ARM, 0]
        self._home: list[float] = self._joints.tolist()
        arm = describe_arm(description.joints, description.bodies)
        chain = arm_chain(description.bodies)
        bounds = JointBounds(
            lower=tuple(axis.minimum for axis in arm.joints),
            upper=tuple(axis.maximum for axis in arm.joints),
            rates=RATES,
        )
        capsules = body_capsules([body for body in description.bodies if chain.has(body.name)])
        pairs = separate_pairs(chain, capsules, self._home)
        keeps_off = (Clearance(chain, capsules, pairs),)
        place = ToolPlace(tuple(range(COUNT)), tuple(range(COUNT, COUNT + len(arm.axes.all))))
        solver = tool_solver(chain, bounds, arm.axes, keeps_off=keeps_off)
        self._tool = PosedTool(arm.pose.name, place, chain, solver, RATES, self._home)
        self._size = COUNT + len(arm.axes.all)
        self._axes = description.axes
        self._now = now
        self._ticked_at = now()
        self.moving = False  # a goal moved in the last tick
        self.pursues = False  # a command drives the tool

    @property
    def faults(self) -> list[str]:
        return self._tool.faults

    def drive(self, values: Sequence[float] | None, seconds: float) -> None:
        """Take the applied goals for the coming `seconds`; None: at rest."""
        before, self._ticked_at = self._ticked_at, self._now()
        rates = np.zeros(COUNT)
        joints: list[float] = self._joints.tolist()
        if values is not None:
            rates = self._tool.drive(values, seconds, self._ticked_at - before, joints, pursues=self.pursues)
        self.moving = bool(rates.any())
        held = np.clip(self._tool.goals, self._joints - LEAD, self._joints + LEAD)
        # A servo follows a moving target with its lag; aiming ahead by that makes the arm stop at its target.
        self._aims[:] = held + rates * self._lags

    def prepare(self) -> None:
        """Compute what the next `drive` needs of the joints alone."""
        self._tool.prepare()

    def stay(self) -> None:
        """Stay where the goals are until the values change."""
        self._tool.hold()

    def release(self) -> None:
        """Hold the arm's present posture."""
        self._tool.hold(self._joints.tolist())

    def restart(self) -> None:
        """Stay where the goals are, whatever the next values are."""
        self._tool.restart()

    def rates(self, values: Sequence[float]) -> Sequence[float] | None:
        """None: each limit knows its axis' gain."""

    def measured(self) -> list[float]:
        """Return the measured value of each axis."""
        joints: list[float] = self._joints.tolist()
        return [*joints, *self._tool.pose_at(joints)]

    def pursued(self) -> list[float]:
        """Return the goal of each axis."""
        goals = [0.0] * self._size
        self._tool.put_pursued(goals)
        return goals

    def home(self, tick: float) -> ActionRun:
        """Return the action that brings the arm home, by goals that pass through the bridge as an operator's do."""
        goals = dict(enumerate(self._home, start=BASE.stop))
        return GoTo(goals, self._axes, self._all_joints.tolist, tick, "the arm is at home")
