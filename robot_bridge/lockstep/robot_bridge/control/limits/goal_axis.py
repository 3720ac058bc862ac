"""Shapes one goal axis: the applied goal goes to the commanded one. No I/O, no clock.

A goal axis is a rate axis on the speed of its applied goal, and an integrator behind it: hold, brake and the limits
work on the speed. docs/robot-link.md, "Goal axes", has the rules.
"""

import math
from typing import Final

from lockstep.protocol.description import Axis

__all__ = ["GoalAxis", "shorter_way", "stopping_speed"]

ROUNDING: Final = 1e-6  # of a step or a speed: what is so close to another counts as it, whatever rounding added up


class GoalAxis:
    """The applied goal of an axis, and its speed. It has the methods of `RateAxis`.

    Attributes:
        goal: applied last, 1.2 rad; NaN until the axis was measured
        waits: the axis must not be driven yet, because others that move the same joints still move
        settling: s in which the robot may still come nearer to the goal after it stood still
        is_pursued: the robot may go on towards the goal in this tick, though it stands still; settling begins after it
    """

    __slots__ = (
        *("_acceleration", "_brake", "_end", "_gap", "_maximum", "_minimum", "_planned", "_reach", "_slew", "_speed"),
        *("_before", "_settles", "_steepest", "_target", "_wrap"),
        *("goal", "is_driven", "is_pursued", "rate", "settling", "waits"),
    )

    rest_rate: Final = 0.0

    def __init__(self, axis: Axis, settling: float = 0.0) -> None:
        self._minimum, self._maximum = axis.minimum, axis.maximum
        self._wrap = axis.wrap
        self._slew, self._brake, self._reach = axis.slew, axis.brake, axis.reach
        self._acceleration = axis.acceleration or axis.brake
        # From a speed that is planned with the lesser of the two, either brings the goal to a standstill in time.
        self._planned = min(self._acceleration, axis.brake)
        self._steepest = max(self._acceleration, axis.brake)
        self._target = 0.0
        self._speed = axis.slew  # unit/s, of the present command at most
        self._gap = 0.0  # way from the goal to the target before this tick
        self._end = 0.0  # the target, so that the goal plus the way is exactly there
        self.goal = math.nan
        self.rate = 0.0  # unit/s, of the goal in the tick that was applied last
        self.is_driven = False
        self.is_pursued = False
        self.waits = False
        self.settling = settling
        self._settles = 0.0  # s for which the robot may still come nearer to the goal
        self._before = math.nan  # the goal before the last tick

    @property
    def stands(self) -> bool:
        """True if the goal stands still, and the robot has had the time to settle."""
        return not self.rate and self._settles <= 0.0

    @property
    def may_move(self) -> bool:
        """True if a command drives the axis now and gives it a speed."""
        return self.is_driven and not self.waits and self._speed > 0.0

    @property
    def is_known(self) -> bool:
        """False until the axis was measured: it has no goal then."""
        return self.goal == self.goal  # NaN differs from itself

    @property
    def applied_goal(self) -> float | None:
        """The applied goal; None before the axis was measured."""
        return self.goal if self.is_known else None

    @property
    def value(self) -> float:
        """The value that the robot gets."""
        return self.goal

    def drive(self, value: float | None, speed: float) -> None:
        """Aim for a goal, at a share `speed` of the axis' largest speed; None: brake, and stay."""
        self.is_driven = value is not None and self.is_known
        if value is not None:
            self._target = value
            self._speed = self._slew * speed

    def next_rate(self, left: float, dt: float, released: bool) -> float:
        """Return the speed that is wanted for a tick of `dt` s, `left` s before the goal has to stand still.

        `released`: it brakes.
        """
        if released or not self.is_driven or self.waits:
            self._gap = 0.0
            if not self.rate:
                return 0.0
            rate = self.braked(dt)
        else:
            rate = self._towards_target(dt)
        left -= self.settling
        reach = self._brake * left if left > 0.0 else 0.0
        return reach if rate > reach else -reach if rate < -reach else rate

    def braked(self, dt: float) -> float:
        """Return the speed after one tick of braking."""
        rate, step = self.rate, self._brake * dt
        return max(0.0, rate - step) if rate > 0 else min(0.0, rate + step)

    def take(self, rate: float, dt: float) -> float:
        """Apply a speed for a tick of `dt` s; return the goal at its end."""
        self.rate = rate
        self._before = self.goal
        if rate or self.is_pursued:
            self._settles = self.settling
        elif self._settles > 0.0:
            self._settles -= dt
            if self._settles < ROUNDING * dt:
                self._settles = 0.0
        if rate:
            way = rate * dt
            if abs(way - self._gap) <= ROUNDING * abs(way):
                self.goal = self._end
            else:
                goal = self.goal + way
                if self._wrap is None and not self._minimum <= goal <= self._maximum:
                    goal = inwards(goal, self.goal, self._minimum, self._maximum)
                self.goal = goal
        return self.goal

    def take_back(self) -> None:
        """Undo the motion of the last `take`, whose goal was not applied."""
        self.goal = self._before

    def cut(self) -> None:
        """Stand still at once, where the goal is."""
        self.rate = self._settles = 0.0
        self.is_pursued = False

    def reaches(self, place: float, goal: float) -> bool:
        """Return whether a goal is within reach of a place; False if one of them is not known."""
        way = goal - place if self._wrap is None else shorter_way(place, goal, self._wrap)
        return abs(way) <= self._reach

    def begin(self, place: float) -> None:
        """Begin to be commanded from a place; NaN: it is not known."""
        self.goal = self._before = place if math.isfinite(place) else math.nan
        self.cut()

    def _towards_target(self, dt: float) -> float:
        if self._wrap is None:
            end = self._target
            if not self._minimum <= end <= self._maximum:
                end = inwards(end, self.goal, self._minimum, self._maximum)
            self._end = end
            self._gap = gap = end - self.goal
        else:
            self._gap = gap = shorter_way(self.goal, self._target, self._wrap)
            self._end = self.goal + gap
        distance, wanted = abs(gap), self._speed
        # Further away than that, the full speed can be braked in any case (the ticks add less than one at full speed).
        if distance < wanted * (wanted / (2.0 * self._planned) + dt):
            wanted = min(wanted, stopping_speed(distance, self._planned, dt))
        if gap < 0.0:
            wanted = -wanted
        rate = self.rate
        if rate == wanted:
            return rate
        faster, slower = self._acceleration * dt, self._steepest * dt
        stands_next = slower * (1.0 + ROUNDING)
        if rate >= 0.0:
            lowest = rate - slower if rate > stands_next else min(0.0, rate - faster)
            return min(max(wanted, lowest), rate + faster)
        highest = rate + slower if -rate > stands_next else max(0.0, rate + faster)
        return max(min(wanted, highest), rate - faster)


def inwards(goal: float, before: float, minimum: float, maximum: float) -> float:
    """Return the limit that a goal is beyond; from a goal that was beyond it before, it may only move back."""
    if goal > maximum:
        return min(goal, max(maximum, before))
    return max(goal, min(minimum, before))


def stopping_speed(distance: float, braking: float, dt: float) -> float:
    """Return the largest speed from which a goal stands still within `distance`, in ticks of `dt` s.

    The speed holds for one tick, and decreases by `braking * dt` in each tick after it.
    """
    step = braking * dt  # unit/s, by which the speed decreases in a tick
    ticks = math.floor((math.sqrt(1.0 + 8.0 * distance / (step * dt)) - 1.0) / 2.0)  # of braking, after the first
    return distance / (dt * (ticks + 1)) + step * ticks / 2.0


def shorter_way(place: float, target: float, wrap: float) -> float:
    """Return the way from a place to a target where values that differ by `wrap` are the same place."""
    way = target - place
    return math.remainder(way, wrap) if math.isfinite(way) else way
