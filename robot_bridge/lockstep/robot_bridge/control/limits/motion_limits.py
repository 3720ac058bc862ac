"""Limits the shaped rates by all position limits and geofences before they reach the robot. No I/O, no clock.

The *value* of an axis is here what it is to the limits: the value of a rate axis, the speed of a goal axis' goal.

In every tick each limit asks: with these values, and all axes braking from the next tick on, does the robot stay within
bounds? If not, the axes that lead out of them are scaled down, towards rest only: no axis moves that was not told to.
If even that would need a steeper ramp than the axes' brake, all limited axes brake. That continues the motion that was
found to be good a tick before.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from lockstep.protocol.description import PositionLimit, RobotDescription
from lockstep.robot_bridge.control.limits.geofence import FenceGuard
from lockstep.robot_bridge.control.limits.joint_limit_guard import JointLimitGuard, is_by_posture
from lockstep.robot_bridge.control.limits.position_guard import PositionGuard
from lockstep.robot_bridge.control.limits.rate_axis import rest_rate
from lockstep.robot_bridge.control.limits.stopping_distance import Demand, share_of

__all__ = ["MotionLimits", "PositionSense"]

LINGER = 0.2  # s that a limit counts as acting after it last did, so that one push against it is one spell


class PositionSense(Protocol):
    """The part of the robot that the limits need."""

    def positions(self) -> Sequence[float]: ...
    def joint_rates(self, values: Sequence[float]) -> Sequence[float] | None: ...


class MotionLimits:
    """Limits the values of all axes. Call it once a tick, with the wanted values.

    Attributes:
        acting: names of the limits that slow an axis now
        blind: names of the limits among them that slow it because the position is not known
    """

    def __init__(
        self,
        description: RobotDescription,
        sense: PositionSense,
        tick_seconds: float,
        *,
        longest_tick: float | None = None,
    ) -> None:
        """`longest_tick`: the most seconds from one tick to the next; None: `tick_seconds`."""
        reaction = tick_seconds if longest_tick is None else longest_tick
        self.acting: frozenset[str] = frozenset()
        self.blind: frozenset[str] = frozenset()
        self._linger = round(LINGER / tick_seconds)  # calls
        self._lingering: dict[str, int] = {}  # limit -> calls that it still counts as acting
        self._sense = sense
        self._rest_values = [rest_rate(axis) for axis in description.axes]
        self._positions = [
            PositionGuard(limit, description, reaction)
            for limit in description.position_limits
            if not is_by_posture(limit)
        ]
        self._postures = posture_guards(description, reaction)
        base = description.planar_base
        self._fence = FenceGuard(base, description, reaction) if base and description.geofences else None
        guarded = {number for guard in self._positions for number in guard.axes}
        guarded.update(number for guard in self._postures for number in guard.axes)
        guarded.update(() if self._fence is None else self._fence.axes)
        self._guarded = tuple(sorted(guarded))

    def __call__(self, values: list[float], braked: Callable[[], Sequence[float]]) -> list[float]:
        """Return the values that may be applied instead of `values`. `braked`: returns them after a tick of braking."""
        rests = self._rest_values
        for number in self._guarded:
            if values[number] != rests[number]:
                return self._limit(values, braked)
        if self.acting:
            self._lingering.clear()
            self.acting = self.blind = frozenset()
        return values

    def _limit(self, values: list[float], braked: Callable[[], Sequence[float]]) -> list[float]:
        shares: dict[int, float] = {}
        excessive: list[Demand] = []
        for demand in self._demands(values):
            share = share_of(demand)
            if share < 1.0 and demand.axes:
                excessive.append(demand)
                for number in demand.axes:
                    shares[number] = min(share, shares.get(number, 1.0))
        if excessive or self._lingering:
            self._note(excessive)
        return self._scaled(values, braked(), shares) if shares else values

    def _note(self, excessive: list[Demand]) -> None:
        self._lingering = {name: left - 1 for name, left in self._lingering.items() if left > 1}
        self._lingering.update((demand.limit, self._linger) for demand in excessive)
        self.acting = frozenset(self._lingering)
        self.blind = frozenset(demand.limit for demand in excessive if demand.is_blind)

    def _demands(self, values: list[float]) -> list[Demand]:
        offsets = [value - rest for value, rest in zip(values, self._rest_values, strict=True)]
        joints = self._sense.positions()
        demands = [] if self._fence is None else self._fence.demands(offsets, joints)
        for guard in self._positions:
            demands += guard.demands(offsets, joints)
        if self._postures:
            rates = self._sense.joint_rates(values)
            for postures in self._postures:
                demands += postures.demands(offsets, joints, rates)
        return demands

    def _scaled(self, values: list[float], braked: Sequence[float], shares: dict[int, float]) -> list[float]:
        limited = list(values)
        for number, share in shares.items():
            rest = self._rest_values[number]
            limited[number] = rest + share * (values[number] - rest)
        if all(self._is_gentle(number, limited[number], braked[number]) for number in shares):
            return limited
        for number in self._guarded:
            limited[number] = self._braking(number, values[number], braked[number])
        return limited

    def _is_gentle(self, number: int, value: float, braked: float) -> bool:
        """Return whether the axis gets to `value` without a ramp that is steeper than its brake."""
        rest = self._rest_values[number]
        return (value - rest) * (braked - rest) >= 0 and abs(value - rest) >= abs(braked - rest)

    def _braking(self, number: int, value: float, braked: float) -> float:
        """Return the braking value, or the wanted one if that is nearer to rest on the same side."""
        rest = self._rest_values[number]
        same_side = (value - rest) * (braked - rest) > 0
        return value if same_side and abs(value - rest) < abs(braked - rest) else braked


def posture_guards(description: RobotDescription, tick_seconds: float) -> list[JointLimitGuard]:
    """Return a guard for each set of axes of the limits that depend on the posture."""
    index = {axis.name: number for number, axis in enumerate(description.axes)}
    together: dict[tuple[int, ...], list[PositionLimit]] = {}
    for limit in filter(is_by_posture, description.position_limits):
        together.setdefault(tuple(index[each.axis] for each in limit.axes), []).append(limit)
    return [JointLimitGuard(axes, limits, description, tick_seconds) for axes, limits in together.items()]
