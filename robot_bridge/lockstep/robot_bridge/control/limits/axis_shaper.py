"""Shapes commanded axis values into applied ones: clamp, slew, hold, brake. No I/O, no clock.

It works on *rates*: the value of a rate axis, and the speed of the applied goal of a goal axis. Every rate stays inside
an envelope around rest that closes at the axis' `brake` and has closed `hold` seconds after the last execution. So a
command never outlives `hold`. A tick changes a rate by no more than its slope (`slew`, `brake`, `acceleration`) times
the period; where the envelope moves it, by no more than `brake` times the seconds since the tick before.

That bounds the slope over periods, not between any two moments: where a command may begin the tick of its period
(`ticks_on_command`), two ticks, and so two steps of a ramp, may follow each other at once, and the next one come up to
two periods later. A limiter (position limits, geofences) has the last word on the rates.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

from lockstep.protocol.description import Axis, Pose
from lockstep.protocol.neutral import has_goals
from lockstep.robot_bridge.control.goals.pose_turns import PoseTurns
from lockstep.robot_bridge.control.limits.goal_axis import GoalAxis
from lockstep.robot_bridge.control.limits.rate_axis import RateAxis

__all__ = ["LATE_TIMER", "AxisShaper", "Limiter"]

LATE_TIMER: Final = 0.002  # s by which the next tick may come late all the same; a busy machine's is later
ROUNDING: Final = 1e-6  # unit: goals that are so close to each other are the same

# (rates, what they would be under braking) -> rates nearer to rest
Limiter = Callable[[list[float], Callable[[], list[float]]], list[float]]


class AxisShaper:
    """The applied values of all axes.

    Call `begin` if there are goal axes; then `drive` at execution, `rest` to come to rest
    early, and `step` or, after a failure, `brake` once a tick.

    Attributes:
        has_goals: whether any axis is a goal axis
        is_known: False while a goal axis was not measured: nothing can be applied then
    """

    def __init__(
        self,
        axes: Sequence[Axis],
        *,
        hold: float,
        limiter: Limiter | None = None,
        poses: Sequence[Pose] = (),
        pursued: Callable[[], Sequence[float]] | None = None,
    ) -> None:
        """`pursued`: returns the goal of each axis that the robot pursues now; needed if there are `poses`."""
        self.has_goals = has_goals(axes)
        self.is_known = not self.has_goals
        settling = {name: pose.settling for pose in poses for name in (*pose.position, *pose.rotation)}
        self._axes = tuple(
            GoalAxis(axis, settling.get(axis.name, 0.0)) if axis.kind == "goal" else RateAxis(axis) for axis in axes
        )
        self._grips = tuple(axis.grips for axis in axes)
        self._hold = hold
        self._limiter = limiter
        self._turns = None if pursued is None or not poses else PoseTurns(axes, poses, self._axes, pursued)
        self._released = True  # coming to rest or there
        self._begins = False  # the robot was not told the goals of the last `begin` yet
        self._deadline = -math.inf  # s, when all axes must be at rest

    @property
    def values(self) -> list[float]:
        """The values applied last."""
        return [axis.value for axis in self._axes]

    @property
    def goals(self) -> list[float | None]:
        """Where each goal axis is commanded to be now, None for a rate axis and an unknown goal; empty without any."""
        if not self.has_goals:
            return []
        goals = [axis.applied_goal for axis in self._axes]
        return goals if self._turns is None else self._turns.as_brought(goals)

    @property
    def at_rest(self) -> bool:
        """True if all axes are at rest, none is to leave it, and the robot has had the time to settle."""
        released = self._released
        return all(axis.stands and (released or not axis.is_driven) for axis in self._axes)

    @property
    def may_take_up(self) -> bool:
        """True if all stands, and the robot was told where: after an arm has fallen it still pursues other goals."""
        return self.has_goals and self.is_known and not self._begins and self.at_rest

    @property
    def pursued_poses(self) -> Sequence[str]:
        """The poses with `settling` that the robot pursues in the tick of the last step, see `Robot.pursue_poses`."""
        return () if self._turns is None or self._released else self._turns.pursued_poses

    def take_settled(self) -> bool:
        """Return whether a pose has settled since the last call: from then on `goals` says where."""
        if self._turns is None or not self._turns.settled:
            return False
        self._turns.settled = False
        return True

    def begin(self, places: Sequence[float], pursued: Sequence[float]) -> bool:
        """Command the goal axes from where they are held: from the goals that the robot pursues. True if all are known.

        `places`: measured, one per axis; NaN: not known. If one of the goals is further than its axis' reach from its
        place, the robot is not where it says, and the places count: all, since a pose and its joints belong together.
        A gripper counts by itself: an arm that has fallen does not open the hand that holds something.
        """
        self._released = self._begins = True
        holds = [axis.reaches(place, goal) for axis, place, goal in zip(self._axes, places, pursued, strict=True)]
        whole = all(each or grips for each, grips in zip(holds, self._grips, strict=True))
        for axis, grips, held, place, goal in zip(self._axes, self._grips, holds, places, pursued, strict=True):
            axis.begin(goal if (held if grips else whole) else place)
        self.is_known = all(axis.is_known for axis in self._axes)
        if self._turns is not None:
            self._turns.begin()
        return self.is_known

    def take_up(self, pursued: Sequence[float]) -> bool:
        """Command goal axes at rest from where the robot pursues them now; return whether that is another place.

        Something else may have moved the robot since its axes came to rest, and the next goals are bound to these.

        `pursued`: the goals of the robot's own, one per axis, as of `Robot.take_up`; NaN: that axis stays as it is.
        Measured places do not do: an arm that hangs below its goals under a load would go down step by step.
        """
        if not self.may_take_up:
            return False
        read = () if self._turns is None else self._turns.unread
        moved = [
            (axis, goal)
            for number, (axis, goal) in enumerate(zip(self._axes, pursued, strict=True))
            if isinstance(axis, GoalAxis)
            and number not in read
            and math.isfinite(goal)
            and abs(goal - axis.goal) > ROUNDING
        ]
        for axis, goal in moved:
            axis.begin(goal)
        return bool(moved)

    def drive(self, values: Sequence[float | None], now: float, speed: float = 1.0) -> None:
        """Aim for `values`, one per axis, clamped to the axes' limits. Numbers are finite; None: a goal axis stays.

        `speed`: of the goal axes, as a share of their largest, 0 to 1.
        """
        for axis, value in zip(self._axes, values, strict=True):
            axis.drive(value, speed)
        self._released = False
        self._deadline = now + self._hold

    def rest(self) -> None:
        """Come to rest at the brake rate from the next step on."""
        self._released = True

    def brake(self, dt: float) -> list[float]:
        """Take one step towards rest at the brake rate, from any target, without asking the limiter."""
        self._released = True
        if self._turns is not None:
            self._turns.pursue(0.0)
        return [axis.take(axis.next_rate(math.inf, dt, True), dt) for axis in self._axes]

    def cut(self) -> None:
        """Be at rest without a ramp, because the robot's motion meanwhile is unknown. Goals stay where they are."""
        self._released = True
        for axis in self._axes:
            axis.cut()

    def take_back(self) -> None:
        """Undo the goals' motion of the last `step`, whose values were not applied."""
        for axis in self._axes:
            axis.take_back()

    def step(self, now: float, dt: float) -> list[float]:
        """Return the values for a tick of `dt` seconds that begins now."""
        self._begins = False
        left = self._deadline - now - dt - LATE_TIMER  # what this tick applies lasts until the next one
        if left <= 0:
            self._released = True
        released = self._released
        if self._turns is not None and not released:
            self._turns.take()
        wanted = rates = [axis.next_rate(left, dt, released) for axis in self._axes]
        if self._limiter is not None:
            rates = self._limiter(rates, lambda: [axis.braked(dt) for axis in self._axes])
        if self._turns is not None:
            slowed = [axis for axis, rate, most in zip(self._axes, rates, wanted, strict=True) if rate != most]
            self._turns.pursue(0.0 if released else left, slowed)
        values = [axis.take(rate, dt) for axis, rate in zip(self._axes, rates, strict=True)]
        if self._turns is not None:
            self._turns.settle(released)  # from this tick on `at_rest` may be true, and `goals` says where
        return values
