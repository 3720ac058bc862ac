"""Operators that drive the arm's joints: a policy, and a leader arm through a clutch. No I/O, no clock."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from lockstep.bench.pick_place.motions import POSITION, ROTATION
from lockstep.bench.pick_place.script import APPLIED
from lockstep.client import Clutch
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.kinematics.rotations import from_rotation_vector
from lockstep.robot_bridge.robots.so101.controls import JOINT_AXES
from lockstep.robot_bridge.robots.so101.model import ARM
from lockstep.robot_bridge.robots.so101.reach import arm_chain, arm_solver

__all__ = ["LEADER_SCALES", "LeaderHand", "PolicyHand", "policy"]

Array = npt.NDArray[np.float64]

JOINTS: Final = tuple(axis.name for axis in JOINT_AXES)
TICK: Final = 0.01  # s, of the solver's steps towards a posture
STEPS: Final = 600  # at most; about a hundred are taken
STANDS: Final = 1e-5  # rad of a step, from which on the posture is found; the last steps only creep
POLICY_STEP: Final = 0.35  # rad, of the policy's output from the measured joints: half of their reach
LEADER_STEP: Final = 0.25  # rad, of the arm's motion that the leader asks for with one event
# The leader is another arm: its elbow is mounted the other way round, its gripper opens half as far.
LEADER_SCALES: Final[Mapping[str, float]] = dict.fromkeys(JOINTS, 1.0) | {"elbow_flex": -1.0, "gripper": 2.0}
LEADER_BEGINS: Final = 0.4  # rad, of each of its joints: engaging the clutch there must not move the arm


class Postures:
    """Joint positions for a motion's goals, solved from where the arm is, once for each motion."""

    def __init__(self, description: RobotDescription) -> None:
        self._solver = arm_solver(description, arm_chain(description))
        self._goals: Mapping[str, float] | None = None
        self._joints = np.zeros(len(JOINTS))

    def of(self, goals: Mapping[str, float], feedback: Feedback) -> Array:
        """Return a position for each of JOINTS, rad; those that the goals say nothing of stay at their applied goal."""
        if goals is not self._goals:
            self._goals, self._joints = goals, self._solved(goals, applied(feedback))
        return self._joints

    def applied(self, goals: Mapping[str, float], feedback: Feedback) -> bool:
        """Return whether the joints' applied goals are this position."""
        return bool(np.abs(self.of(goals, feedback) - applied(feedback)).max() < APPLIED)

    def _solved(self, goals: Mapping[str, float], joints: Array) -> Array:
        if "gripper" in goals:
            return np.array([*joints[ARM], goals["gripper"]])
        position = np.array([goals[name] for name in POSITION])
        rotation = from_rotation_vector([goals[name] for name in ROTATION])
        arm = tuple(joints[ARM].tolist())
        for _ in range(STEPS):
            before, arm = arm, self._solver.step(arm, position, rotation, TICK).joints
            if max(abs(new - old) for new, old in zip(arm, before, strict=True)) < STANDS:
                break  # the console's loop waits for this, and a silent client loses the seat
        return np.array([*arm, joints[-1]])


def applied(feedback: Feedback) -> Array:
    """Return the applied goals of the joints, rad; the description's first axes."""
    return np.array([goal or 0.0 for goal in feedback.goals[: len(JOINTS)]])


def policy(joints: Array, wanted: Array) -> Array:
    """Return the joint positions to be commanded, rad, from the measured ones and those of the task's next posture."""
    return joints + np.clip(wanted - joints, -POLICY_STEP, POLICY_STEP)


class PolicyHand:
    """Returns absolute joint positions for each observation, as a trained policy does."""

    def __init__(self, description: RobotDescription) -> None:
        self._postures = Postures(description)

    def values(self, goals: Mapping[str, float], feedback: Feedback) -> Mapping[str, float | None]:
        wanted = self._postures.of(goals, feedback)
        found = policy(np.array(feedback.axes[: len(JOINTS)]), wanted)
        found[-1] = wanted[-1]  # the block keeps the fingers from their goal, and the goal is the grip
        return dict(zip(JOINTS, found.tolist(), strict=True))

    def applied(self, goals: Mapping[str, float], feedback: Feedback) -> bool:
        return self._postures.applied(goals, feedback)


class LeaderHand:
    """A person who moves a leader arm until the follower is where they want it, through a clutch.

    Attributes:
        clutch: engaged with the first feedback, and anew whenever it was released
        engagements: how often
    """

    def __init__(self, description: RobotDescription, clutch: Clutch) -> None:
        """`clutch`: of the axes in LEADER_SCALES."""
        self.clutch = clutch
        self.engagements = 0
        self._postures = Postures(description)
        self._device: list[float] = [LEADER_BEGINS] * len(LEADER_SCALES)  # rad
        self._asked = np.zeros(len(JOINTS))  # rad, of the follower, with the last event

    def values(self, goals: Mapping[str, float], feedback: Feedback) -> Mapping[str, float | None]:
        if not self.clutch.engaged:
            self._engage(feedback)
        wanted = self._postures.of(goals, feedback)
        here = applied(feedback)
        self._move(here + np.clip(wanted - here, -LEADER_STEP, LEADER_STEP))
        return self.clutch.values(self._device)

    def applied(self, goals: Mapping[str, float], feedback: Feedback) -> bool:
        return self._postures.applied(goals, feedback)

    def _engage(self, feedback: Feedback) -> None:
        self.clutch.observe(feedback)
        self.engagements += self.clutch.engage(self._device)
        self._asked = applied(feedback)

    def _move(self, asked: Array) -> None:
        scales: Sequence[float] = [LEADER_SCALES[name] for name in JOINTS]
        self._device = (np.array(self._device) + (asked - self._asked) / scales).tolist()
        self._asked = asked
