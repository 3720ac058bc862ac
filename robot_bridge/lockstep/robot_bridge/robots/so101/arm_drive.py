"""Turns the applied goals into joint goals: those of the joints as they are, a tool's pose by inverse kinematics.

The bridge changes the goals of the set of axes that is driven and leaves the others as they were, so the values tell
which set is driven. The bridge says besides whether to pursue the tool's goal while it stands still. No I/O, no clock.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.pose_solver import PoseSolver, Prepared
from lockstep.robot_bridge.kinematics.rotations import from_rotation_vector, rotation_vector

__all__ = ["SETTLES", "ArmDrive"]

Array = npt.NDArray[np.float64]

SAME: Final = 1e-9  # rad and m
SETTLES: Final = 0.12  # s in which the tool may come nearer to a goal that stands still and is pursued no more
AHEAD: Final = 0.7  # rad that a joint's goal is at most ahead of the joint while the tool is driven
TURNED_AWAY: Final = 2.6  # rad between the tool and its goal, from which on it does not turn: either way is as short
TURNED_BACK: Final = 0.5  # rad, from which on it turns again
SLOWS: Final = 0.08  # s, the last of these, in which it comes to a standstill


class _Tool(NamedTuple):
    position: Array
    rotation: Array
    vector: Array  # rad, the rotation as a vector


class _ToolGoal(NamedTuple):
    """Of the tool."""

    position: Array
    rotation: Array  # 3 x 3


class ArmDrive:
    """Keeps the joint goals. They never move faster than `rates`, whatever is applied.

    A joint that cannot keep up with the tool's goal leaves the tool behind it. While the goal is pursued, the tool goes
    on until it has arrived. When that ends, because nothing follows or a stop was pressed, it comes to rest within
    SETTLES, whether or not it has arrived.
    """

    def __init__(self, chain: Chain, solver: PoseSolver, rates: Sequence[float], posture: Sequence[float]) -> None:
        """`rates`: rad/s of the arm's joints. `posture`: rad, where the arm is."""
        self._chain = chain
        self._solver = solver
        self._rates = tuple(rates)
        self._count = len(rates)
        self._goals = tuple(posture)
        self._before: tuple[float, ...] | None = None  # values of the tick before
        self._joints: tuple[float, ...] | None = None  # goals of the joints while they are driven
        self._pose: _ToolGoal | None = None  # while the tool is driven
        self._motion = np.zeros(6)  # m/s and rad/s, of that goal in the present tick
        self._solved = (0.0,) * self._count  # rad/s, in the last tick for the tool
        self._still = math.inf  # s since the pose's goal changed or was pursued
        self._pursued = False  # the tool's goal was pursued in the last tick
        self._turns = True  # the tool follows the rotation of its goal
        self._prepared: Prepared | None = None  # for the next step of the solver
        self._tool: _Tool | None = None  # of the present goals
        self.faults: list[str] = []

    @property
    def goals(self) -> tuple[float, ...]:
        """The joints' goals now, rad."""
        return self._goals

    def hold(self, posture: Sequence[float] | None = None) -> None:
        """Stay where the goals are, or in a posture, until the values change.

        Without a posture, the values of the next tick count as those that stand still: the tick that was held up may
        have changed them, and nobody drives any more.
        """
        if posture is None:
            self._before = None
        else:
            self._goals = tuple(posture)
        self._joints = self._pose = self._tool = None
        self._still = math.inf
        self.faults = []

    def restart(self) -> None:
        """Stay where the goals are, whatever the next values are."""
        self.hold()

    def prepare(self) -> None:
        """Compute what the next `drive` needs of the joints alone, if it goes on with the tool."""
        self._prepared = None if self._pose is None else self._solver.prepare(self._goals, self._solved)

    def pursued(self) -> list[float]:
        """Return what the joints' goals are, and the tool's pose at them."""
        tool = self._at(self._goals)
        return [*self._goals, *tool.position.tolist(), *tool.vector.tolist()]

    def drive(
        self,
        values: Sequence[float],
        seconds: float,
        since: float = 0.0,
        measured: Sequence[float] | None = None,
        *,
        pursues: bool = False,
    ) -> Array:
        """Take the applied goals of joints and pose; return the joints' rates for the coming `seconds`, rad/s.

        `since`: s since the call before. Where it is more than `seconds`, calls were held up, and settling counts it.
        `measured`: rad, where the joints are; None: where their goals are. `pursues`: go on to the tool's
        goal while it stands still.
        """
        self._still += max(since - seconds, 0.0)
        self._choose(tuple(values), seconds, pursues)
        before = self._goals
        if self._pose is not None:
            self._follow_pose(self._pose, seconds)
            if measured is not None:
                self._keep_near(before, measured, seconds)
        elif self._joints is not None:
            self._goals = tuple(
                place + min(max(goal - place, -rate * seconds), rate * seconds)
                for place, goal, rate in zip(before, self._joints, self._rates, strict=True)
            )
        if self._goals is before:
            return np.zeros(self._count)
        self._tool = None
        return (np.array(self._goals) - before) / seconds

    def _keep_near(self, before: tuple[float, ...], measured: Sequence[float], seconds: float) -> None:
        """Let no goal get further than AHEAD from its joint: what blocks the arm must not store motion for later."""
        kept = tuple(
            min(max(goal, min(old, place - AHEAD)), max(old, place + AHEAD))
            for goal, old, place in zip(self._goals, before, measured, strict=True)
        )
        if kept != self._goals:
            self._goals = kept
            self._solved = tuple((new - old) / seconds for new, old in zip(kept, before, strict=True))

    def _choose(self, values: tuple[float, ...], seconds: float, pursues: bool) -> None:
        """Choose the set that is driven. The tool may begin with the goal that it stopped short of."""
        before, self._before = self._before, values
        joints, pose = values[: self._count], values[self._count :]
        self._motion[:] = 0.0
        if before is None or not all(map(math.isfinite, values)):
            self._pursued = False
            return
        begins, self._pursued = pursues and not self._pursued, pursues
        if pursues:
            self._still = 0.0
        if _differ(joints, before[: self._count]):
            self._joints, self._pose = joints, None
            self.faults = []
        elif begins or _differ(pose, before[self._count :]):
            goal = _ToolGoal(np.array(pose[:3]), from_rotation_vector(pose[3:]))
            if self._pose is None:  # in the first tick the goal was read anew, which is no motion
                self._solved = (0.0,) * self._count
                self._turns = True
            else:
                self._motion = _motion(self._pose, goal) / seconds
            self._joints, self._pose = None, goal
            self._still = 0.0

    def _follow_pose(self, pose: _ToolGoal, seconds: float) -> None:
        share = min(max((SETTLES - self._still) / SLOWS, 0.0), 1.0)
        self._still += seconds
        if share == 0.0:  # the bridge reads its goals anew, from here
            self._solved = (0.0,) * self._count
            self._pose = None
            return
        solution = self._solver.step(
            self._goals,
            pose.position,
            pose.rotation,
            seconds,
            velocity=self._motion[:3],
            spin=self._motion[3:],
            share=share,
            before=self._solved,
            turns=self._turns,
            prepared=self._prepared,
        )
        self._turns = solution.askew < (TURNED_AWAY if self._turns else TURNED_BACK)
        self._goals, self._solved = solution.joints, solution.rates
        self.faults = [f"joint limit: {self._chain.joints[number]}" for number in solution.limited]
        self.faults += [f"the arm is close to {what}" for what in solution.near]
        if not self._turns:
            self.faults.append("the tool's goal is turned too far away from it: turn it back, or let go")

    def _at(self, goals: tuple[float, ...]) -> _Tool:
        if self._tool is None:
            state = self._chain.at(goals)
            self._tool = _Tool(state.position, state.rotation, rotation_vector(state.rotation))
        return self._tool


def _differ(values: tuple[float, ...], others: tuple[float, ...]) -> bool:
    return values != others and any(abs(value - other) > SAME for value, other in zip(values, others, strict=True))


def _motion(before: _ToolGoal, after: _ToolGoal) -> Array:
    """Return the way between two goals, m, and the turn, rad as a rotation vector."""
    turn = rotation_vector(after.rotation @ before.rotation.T)
    return np.concatenate((after.position - before.position, turn))
