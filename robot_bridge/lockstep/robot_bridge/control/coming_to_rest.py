"""Brings a robot to rest even if calls of its adapter raise. No clock, no task: the caller hands in `now`."""

import logging
from collections.abc import Callable

from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.robots.base import Robot

__all__ = ["ComingToRest"]

REPEATS = 3  # ticks in a row in which the adapter has to take the rest values
PATIENCE = 2.0  # s on top of hold for an adapter that does not take them

_logger = logging.getLogger(__name__)


class ComingToRest:
    """Applies values that lead to rest.

    Call `step` every tick until it returns True, or `at_once` if no more ticks will come; then `stop`. Each call of the
    adapter is guarded against any exception: a failed call does not prevent the next one. The values ramp down at the
    axes' brake rates. After an `apply` that raised, the robot's motion is unknown, so the rest values follow at once.
    """

    def __init__(self, robot: Robot, shaper: AxisShaper, hold: float, now: float) -> None:
        self._robot = robot
        self._shaper = shaper
        self._deadline = now + hold + PATIENCE
        self._ramps = True
        self._taken = 0  # ticks in a row in which the adapter took the rest values
        self._logged: set[str] = set()  # calls whose failure was logged

    @property
    def rests(self) -> bool:
        """True if the adapter took the rest values often enough."""
        return self._taken >= REPEATS

    def step(self, now: float) -> bool:
        """Run one tick. True if the robot rests, or if that was tried for long enough."""
        if self._ramps:
            self._shaper.brake(self._robot.tick_seconds)
        else:
            self._shaper.cut()
        taken = self._apply()
        self._attempt("tick", self._robot.tick)
        self._ramps = taken
        self._taken = self._taken + 1 if taken and self._shaper.at_rest else 0
        if not self.rests and now >= self._deadline:
            _logger.critical("the robot could not be brought to rest: its adapter does not take the rest values")
            return True
        return self.rests

    def at_once(self) -> None:
        """Apply the rest values without a ramp and without waiting."""
        self._shaper.cut()
        for _ in range(REPEATS):
            taken = self._apply()
            self._attempt("tick", self._robot.tick)
            self._taken = self._taken + 1 if taken else 0

    def stop(self) -> None:
        """Call the robot's own `stop`, again if it raises."""
        for _ in range(REPEATS):
            if self._attempt("stop", self._robot.stop):
                return

    def _apply(self) -> bool:
        """Apply the values. Where a goal is not known, nothing was ever applied, and the robot's own stop suffices."""
        if not self._shaper.is_known:
            return True
        told = self._attempt("pursue_poses", lambda: self._robot.pursue_poses(()))
        return self._attempt("apply", lambda: self._robot.apply(self._shaper.values)) and told

    def _attempt(self, name: str, call: Callable[[], None]) -> bool:
        try:
            call()
        except BaseException as error:  # also SystemExit and the like: nothing may keep the robot from resting
            if name not in self._logged:
                self._logged.add(name)
                _logger.error("bringing the robot to rest: %s raised %r", name, error)
            return False
        return True
