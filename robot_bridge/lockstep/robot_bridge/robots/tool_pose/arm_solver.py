"""The solver for an arm of any size."""

import math
from collections.abc import Sequence
from typing import Final

from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.clearance import GapSource
from lockstep.robot_bridge.kinematics.pose_solver import JointBounds, PoseSolver, Tuning
from lockstep.robot_bridge.robots.tool_pose.axes import ToolAxes

__all__ = ["tool_solver"]

CATCHES_UP: Final = 1.25  # times its goal's speed, at which a tool that lags goes at most
SPARE_PULL: Final = 0.5  # 1/s, of the posture on joints that the pose leaves free
SAFE: Final = 0.04  # of the arm's length, from which on parts that come nearer to each other are slowed
SAFEST: Final = 0.03  # m, the most of it


def tool_solver(
    chain: Chain,
    bounds: JointBounds,
    axes: ToolAxes,
    *,
    keeps_off: Sequence[GapSource] = (),
    posture: Sequence[float] | None = None,
    turns_first: bool = False,
) -> PoseSolver:
    """Return a solver whose bounds fit the arm's length.

    `posture`: rad or m, that joints tend to which the pose leaves free, of an arm with more than six joints.
    `turns_first`: the rotation is kept where the arm cannot have both it and the position.
    """
    length = chain.length
    safe = min(SAFE * length, SAFEST)
    tuning = Tuning(
        longest=0.1 * length,
        small_linear=0.065 * length,
        damping_linear=0.045 * length,
        bend=0.9 * length,
        posture=SPARE_PULL,
        fastest=CATCHES_UP * math.hypot(*(axis.slew for axis in axes.position)),
        quickest=CATCHES_UP * math.hypot(*(axis.slew for axis in axes.rotation)),
        safe=safe,
        close=0.2 * safe,
        turns_first=turns_first,
    )
    return PoseSolver(
        chain,
        bounds,
        posture=posture if len(chain.joints) > 6 else None,
        keeps_off=keeps_off,
        tuning=tuning,
    )
