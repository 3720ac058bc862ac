"""Operators that drive the arm's joints: a policy, and a leader arm through a clutch. No I/O, no clock."""

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from lockstep.bench.pick_place.motions import POSITION, ROTATION
from lockstep.bench.pick_place.script import APPLIED
from lockstep.client import Clutch
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.kinematics.rotations import from_rotation_vector, rotation_vector
from lockstep.robot_bridge.robots.so101.controls import JOINT_AXES
from lockstep.robot_bridge.robots.so101.model import ARM
from lockstep.robot_bridge.robots.so101.reach import arm_chain, arm_solver

__all__ = ["LEADER_SCALES", "LeaderHand", "PolicyHand"]

Array = npt.NDArray[np.float64]

JOINTS: Final = tuple(axis.name for axis in JOINT_AXES)
TICK: Final = 0.01  # s, of the solver's steps towards a posture
STEPS: Final = 600  # at most; about a hundred are taken
STANDS: Final = 1e-5  # rad of a step, from which on the posture is found; the last steps only creep
PASSES: Final = 1e-3  # rad, likewise of a posture on the way
# m and rad, of the tool from one posture on the way to the next, and on its way down to a block
FAR_STEP, FAR_TURN = 0.06, 0.5
NEAR_STEP, NEAR_TURN = 0.02, 0.25
LOW: Final = 0.06  # m, height of the tool: on the way down to below that, it is near
NEAR: Final = 0.05  # rad, of the applied goals from a posture on the way: it goes on to the next one
POLICY_STEP: Final = 0.35  # rad, of the policy's output from the measured joints: half of their reach
LEADER_STEP: Final = 0.25  # rad, of the arm's motion that the leader asks for with one event
# The leader is another arm: its elbow is mounted the other way round, its gripper opens half as far.
LEADER_SCALES: Final[Mapping[str, float]] = dict.fromkeys(JOINTS, 1.0) | {"elbow_flex": -1.0, "gripper": 2.0}
LEADER_BEGINS: Final = 0.4  # rad, of each of its joints: engaging the clutch there must not move the arm


class Postures:
    """Joint positions that lead to a motion's goals, solved from where the arm is, once for each motion.

    They are those of a tool that goes straight there. Joints that each took their own way would lead it in an arc, and
    the open fingers from the side against the block that they are to close about.
    """

    def __init__(self, description: RobotDescription) -> None:
        self._chain = arm_chain(description)
        self._solver = arm_solver(description, self._chain)
        self._goals: Mapping[str, float] | None = None
        self._path: list[Array] = []  # rad, of each of JOINTS; the last are where the motion ends
        self._passed = 0  # of the path

    def of(self, goals: Mapping[str, float], feedback: Feedback) -> Array:
        """Return the position at the motion's end for each of JOINTS, rad; a gripper's motion moves nothing else."""
        if goals is not self._goals:
            self._goals, self._passed = goals, 0
            self._path = self._solved(goals, applied(feedback))
        return self._path[-1]

    def next(self, goals: Mapping[str, float], feedback: Feedback, joints: Array, step: float) -> Array:
        """Return the position furthest along the way that no joint is further than `step` (rad) from `joints`."""
        end, here = self.of(goals, feedback), applied(feedback)
        if "gripper" in goals:
            return np.array([*end[ARM], *_towards(joints[-1:], end[-1:], step)])
        while self._passed < len(self._path) - 1 and np.abs(self._path[self._passed] - here).max() < NEAR:
            self._passed += 1
        wanted = self._path[self._passed]
        return np.array([*_towards(joints[ARM], wanted[ARM], step), end[-1]])

    def applied(self, goals: Mapping[str, float], feedback: Feedback) -> bool:
        """Return whether the joints' applied goals are the motion's end."""
        return bool(np.abs(self.of(goals, feedback) - applied(feedback)).max() < APPLIED)

    def _solved(self, goals: Mapping[str, float], joints: Array) -> list[Array]:
        if "gripper" in goals:
            return [np.array([*joints[ARM], goals["gripper"]])]
        arm = tuple(joints[ARM].tolist())
        start = self._chain.at(arm)
        way = np.array([goals[name] for name in POSITION]) - start.position
        rotation = from_rotation_vector([goals[name] for name in ROTATION])
        turn = rotation_vector(rotation @ start.rotation.T)
        goes_down = way[2] < 0 and start.position[2] + way[2] < LOW
        step, angle = (NEAR_STEP, NEAR_TURN) if goes_down else (FAR_STEP, FAR_TURN)
        count = math.ceil(max(math.hypot(*way) / step, math.hypot(*turn) / angle, 1.0))
        path = []
        for number in range(1, count + 1):
            share = number / count
            turned = from_rotation_vector((turn * share).tolist()) @ start.rotation
            arm = self._posture(arm, start.position + way * share, turned, STANDS if number == count else PASSES)
            path.append(np.array([*arm, joints[-1]]))
        return path

    def _posture(self, arm: tuple[float, ...], position: Array, rotation: Array, stands: float) -> tuple[float, ...]:
        for _ in range(STEPS):
            before, arm = arm, self._solver.step(arm, position, rotation, TICK).joints
            if max(abs(new - old) for new, old in zip(arm, before, strict=True)) < stands:
                break  # somebody waits for this
        return arm


def _towards(joints: Array, wanted: Array, step: float) -> Array:
    """Return the place on the straight way from `joints` that is `step` away (rad, of the furthest), or the end."""
    way = wanted - joints
    furthest = float(np.abs(way).max())
    return joints + way * min(1.0, step / furthest) if furthest else wanted


def applied(feedback: Feedback) -> Array:
    """Return the applied goals of the joints, rad; the description's first axes."""
    return np.array([goal or 0.0 for goal in feedback.goals[: len(JOINTS)]])


class PolicyHand:
    """Returns absolute joint positions for each observation, as a trained policy does."""

    def __init__(self, description: RobotDescription) -> None:
        self._postures = Postures(description)

    def think(self, goals: Mapping[str, float], feedback: Feedback) -> None:
        self._postures.of(goals, feedback)

    def values(self, goals: Mapping[str, float], feedback: Feedback) -> Mapping[str, float | None]:
        measured = np.array(feedback.axes[: len(JOINTS)])
        found = self._postures.next(goals, feedback, measured, POLICY_STEP)
        # The block keeps the fingers from their goal, and the goal is the grip.
        found[-1] = self._postures.of(goals, feedback)[-1]
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

    def think(self, goals: Mapping[str, float], feedback: Feedback) -> None:
        self._postures.of(goals, feedback)

    def values(self, goals: Mapping[str, float], feedback: Feedback) -> Mapping[str, float | None]:
        if not self.clutch.engaged:
            self._engage(feedback)
        self._move(self._postures.next(goals, feedback, applied(feedback), LEADER_STEP))
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
