"""Drives the arm: turns a twist of the tool into goals of position servos, which hold their posture at rest."""

import math
from collections.abc import Sequence
from operator import sub
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.actions import ActionRun
from lockstep.robot_bridge.robots.mobile_manipulator.homing import Homing
from lockstep.robot_bridge.robots.mobile_manipulator.resolved_rates import Resolution, ResolvedRates
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import ARM, JOINTS, Simulation

__all__ = ["ArmDrive"]

Array = npt.NDArray[np.float64]

FASTEST: Final = (1.5, 1.5, 1.8, 2.5, 2.5, 3.0)  # rad/s
STEADY: Final = 0.002  # rad; an arm that has moved less resolves a twist to the same velocities, to within a hundredth
LEAD: Final = (0.065, 0.065, 0.065, 0.08, 0.08, 0.08)  # rad; with the servos' stiffness, this is the largest push
HOMING_SPEED: Final = 0.6  # rad/s
HOMING_GAIN: Final = 3.0  # 1/s
STILL: Final = (0.0,) * len(FASTEST)


class _Resolved(NamedTuple):
    twist: list[float]
    joints: list[float]  # rad, the posture
    resolution: Resolution


class ArmDrive:
    """Adds up joint velocities to a posture that the servos hold.

    The posture never leads the measured one by more than LEAD, which bounds the push of a blocked arm and keeps it from
    storing up motion. Plain numbers: for six joints numpy costs more, in every tick, than it saves.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._joints = simulation.joints[ARM]  # a view
        self._aims: Array = simulation.data.ctrl[ARM]  # a view
        model = simulation.model
        lower, upper = model.jnt_range[ARM, 0].tolist(), model.jnt_range[ARM, 1].tolist()
        self._names = tuple(model.joint(index).name.removeprefix("arm.") for index in range(ARM.start, JOINTS))
        self._rates = ResolvedRates(lower, upper, FASTEST)
        # For each servo: its lag (kv / kp, s), the farthest it may lead, and its joint's range.
        lags = (-model.actuator_biasprm[ARM, 2] / model.actuator_gainprm[ARM, 0]).tolist()
        self._servos = tuple(zip(lags, LEAD, lower, upper, strict=True))
        self._posture: list[float] = self._joints.tolist()
        self._home = tuple(self._posture)
        self._goes_home = False
        self._resolved: _Resolved | None = None  # the last one
        self._wanted = False
        self.faults: list[str] = []

    def release(self) -> None:
        """Hold the arm's present posture."""
        self._posture = self._joints.tolist()
        self._goes_home = False
        self.faults = []

    def from_home(self) -> list[float]:
        """Return the distance of each joint from the posture in which the arm began, rad."""
        return [abs(joint - home) for joint, home in zip(self._joints.tolist(), self._home, strict=True)]

    def go_home(self) -> None:
        """Move towards that posture while no twist is wanted, until `stay`."""
        self._goes_home = True

    def stay(self) -> None:
        """Go no farther towards that posture."""
        self._goes_home = False

    def _homewards(self) -> Sequence[float]:
        """Return the joints' velocities, rad/s: slower near the goal."""
        return [
            min(max(HOMING_GAIN * (home - place), -HOMING_SPEED), HOMING_SPEED)
            for place, home in zip(self._posture, self._home, strict=True)
        ]

    def rates(self, twist: Sequence[float]) -> Sequence[float]:
        """Return the velocities of the joints, rad/s, that `twist` would cause in the present posture."""
        return self._resolve(twist).velocities if any(twist) else STILL

    @property
    def moving(self) -> bool:
        """A twist was wanted in the last tick."""
        return self._wanted

    def measured(self) -> list[float]:
        """Return the measured value of each axis: the tool's twist."""
        twist: list[float] = self._simulation.tool_twist().tolist()
        return twist

    def pursued(self) -> list[float]:
        """Return the goal of each axis: they are rates, and have none."""
        return [math.nan] * len(FASTEST)

    def restart(self) -> None:
        """Go on after a stop; the arm has held its posture."""

    def home(self, tick: float) -> ActionRun:
        """Return the action that brings the arm home. `tick`: s between two steps."""
        return Homing(self, tick)

    def drive(self, values: Sequence[float] | None, seconds: float) -> None:
        """Use a twist (base frame, m/s and rad/s) for the coming `seconds`; None: at rest."""
        twist = STILL if values is None else values
        self._wanted = any(twist)
        self.faults = []
        velocities = self._follow(twist) if any(twist) else self._homewards() if self._goes_home else STILL
        posture, aims = [], []
        for place, joint, velocity, (lag, lead, lower, upper) in zip(
            self._posture, self._joints.tolist(), velocities, self._servos, strict=True
        ):
            held = min(max(place + velocity * seconds, joint - lead), joint + lead)
            held = min(max(held, lower), upper)
            posture.append(held)
            # A servo follows a moving target with its lag; aiming ahead by that makes the arm stop at its target.
            aims.append(held + velocity * lag)
        self._posture = posture
        self._aims[:] = aims

    def _resolve(self, twist: Sequence[float]) -> Resolution:
        joints, wanted, known = self._joints.tolist(), list(twist), self._resolved
        if known is None or known.twist != wanted or max(map(abs, map(sub, joints, known.joints))) >= STEADY:
            resolution = self._rates.resolve(self._simulation.tool_jacobian(), np.array(wanted), joints)
            known = self._resolved = _Resolved(wanted, joints, resolution)
        return known.resolution

    def _follow(self, twist: Sequence[float]) -> Sequence[float]:
        resolution = self._resolve(twist)
        self.faults = [f"arm joint limit: {self._names[index]}" for index in resolution.limited]
        if resolution.lost:
            self.faults.append("arm cannot reach farther this way")
        return resolution.velocities
