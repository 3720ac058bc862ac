"""One step of the joints towards a pose of the tool, by damped least squares.

The order of priority where not everything is possible: the joints' ranges and rates, the distance between the robot's
own parts and to obstacles, the position, the rotation as far as the joints that are left can turn it, and last the
posture. A part that may come no nearer is a task before the position, so the rotation is given up for it first.

Sources: Nakamura and Hanafusa 1986 (damping near singularities), Sugihara 2011 (damping by the error), Chiaverini 1997
(the later task in the null space of the earlier one, each damped by itself), Faverjon and Tournassoud 1987 (velocity
dampers before limits), Flacco, De Luca and Khatib 2012 (a joint at its bound is taken out, and the others solve anew),
Kanoun, Lamiraux and Wieber 2011 (inequalities before the tasks, by the set of those that bind).
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.chain import Chain, ChainState
from lockstep.robot_bridge.kinematics.clearance import GapSource
from lockstep.robot_bridge.kinematics.gap_limits import GapLimits, clipped, gap_limits
from lockstep.robot_bridge.kinematics.near_gaps import NearGaps
from lockstep.robot_bridge.kinematics.rotations import rotation_vector
from lockstep.robot_bridge.kinematics.task_order import Damping, TaskOrder, task_order

__all__ = ["JointBounds", "PoseSolver", "Prepared", "Solution", "Tuning"]

Array = npt.NDArray[np.float64]

MOST_GAPS: Final = 4  # that bind at once in the order of priority; of more, each is kept by itself


class JointBounds(NamedTuple):
    """Of each joint of the chain, in its order."""

    lower: tuple[float, ...]  # rad or m
    upper: tuple[float, ...]
    rates: tuple[float, ...]  # rad/s or m/s, the fastest
    ramp: float = 0.06  # s in which a joint changes from rest to its fastest rate, at least


class Tuning(NamedTuple):
    """The solver's bounds. The defaults are for an arm of half a metre and ticks of a few milliseconds."""

    gain: float = 20.0  # 1/s: the error decays by that rate
    longest: float = 0.05  # m, of the position error that is worked on at once
    widest: float = 0.4  # rad, of the rotation error that is worked on at once
    small_linear: float = 0.03  # m, singular values of the position's Jacobian below this are damped
    damping_linear: float = 0.02  # m, at a singular value of zero
    small_angular: float = 0.15  # the same for the rotation's Jacobian in the null space of the position's
    damping_angular: float = 0.1
    bend: float = (
        0.4  # m: the tool's way bends by at most 1 m for each 1/bend rad² of the joints; about the arm's length
    )
    posture: float = 1.0  # 1/s: the pull of the posture in what is left
    limit_gain: float = 8.0  # 1/s: a joint's speed towards its limit is at most this times the way to it
    end: float = 0.02  # rad or m from the end of its range, from which on a joint is said to be there
    fastest: float = math.inf  # m/s, of the tool, also where it catches up
    quickest: float = math.inf  # rad/s, the same for its turning
    safe: float = 0.03  # m, from which on parts that come nearer to each other are slowed
    close: float = 0.008  # m, at which they come no nearer
    turns_first: bool = False  # the rotation comes before the position


class Solution(NamedTuple):
    joints: tuple[float, ...]  # rad or m, the next goals
    rates: tuple[float, ...]  # rad/s or m/s, that bring them there
    limited: tuple[int, ...]  # joints that are at the end of their range and would go on
    near: tuple[str, ...]  # what the robot is so close to that it is slowed: "itself", or obstacles
    missing: float  # m, of the position before this step
    askew: float  # rad, of the rotation before this step, at most pi


class Prepared(NamedTuple):
    """What a step needs of the joints alone. It can be computed before the goal is known."""

    joints: tuple[float, ...]
    before: tuple[float, ...] | None
    here: Array
    state: ChainState
    slowest: Array
    fastest: Array
    lowest: Array  # rad or m: no joint goes beyond, nor further beyond if it is already
    highest: Array
    gaps: GapLimits
    order: TaskOrder  # with all joints free, where nothing binds


class PoseSolver:
    """Steps from joint goals to joint goals. What it remembers changes no result: the caller keeps the goals."""

    def __init__(
        self,
        chain: Chain,
        bounds: JointBounds,
        *,
        posture: Sequence[float] | None = None,
        keeps_off: Sequence[GapSource] = (),
        turns: bool = True,
        tuning: Tuning | None = None,
    ) -> None:
        """`posture`: joint positions that the joints tend to. `turns`: False if poses have no rotation."""
        self._chain = chain
        self._lower, self._upper = np.array(bounds.lower), np.array(bounds.upper)
        self._rates = np.array(bounds.rates)
        self._ramp = bounds.ramp
        self._accelerations = self._rates / bounds.ramp
        self._posture = None if posture is None else np.array(posture)
        self._keeps_off = NearGaps(keeps_off)
        self._turns = turns
        self._tuning = tuning or Tuning()

    def prepare(self, joints: Sequence[float], before: Sequence[float] | None = None) -> Prepared:
        """Return what `step` needs of the joints alone, most of its work. `joints`, `before`: as for `step`."""
        here = np.array(joints)
        state = self._chain.at(joints)
        slowest, fastest = self._speeds(here)
        gaps = self._near(here, state, before)
        order = self._order(state, np.ones(len(here), dtype=bool), gaps, [])
        kept = None if before is None else tuple(before)
        lowest, highest = np.minimum(self._lower, here), np.maximum(self._upper, here)
        return Prepared(tuple(joints), kept, here, state, slowest, fastest, lowest, highest, gaps, order)

    def step(
        self,
        joints: Sequence[float],
        position: Array,
        rotation: Array,
        seconds: float,
        *,
        velocity: Array | None = None,
        spin: Array | None = None,
        share: float = 1.0,
        before: Sequence[float] | None = None,
        turns: bool = True,
        prepared: Prepared | None = None,
    ) -> Solution:
        """Return the joint goals after `seconds`.

        `joints`: the goals before. `position` (m) and `rotation` (3 x 3): of the tool. `velocity` (m/s) and `spin`
        (rad/s): of that pose, so that the tool follows it without lag. `share`: of the joints' rates, 0 to 1, for what
        is wanted; where it falls, a joint may be faster while it brakes, or while it keeps a gap that the joints that
        brake would narrow. `before`: the rates of the step before; without them a rate may change at once. `turns`:
        False to keep the rotation that the tool has, as far as its way to the position allows. `prepared`: made by
        `prepare`; it changes no result, and counts only if it was made for these joints and rates.
        """
        if prepared is None or prepared.joints != tuple(joints) or prepared.before != before:
            prepared = self.prepare(joints, before)
        here, state, gaps = prepared.here, prepared.state, prepared.gaps
        tuning = self._tuning
        error = position - state.position
        missing = _length(error)
        wanted = tuning.gain * _shortened(error, tuning.longest) + (0.0 if velocity is None else velocity)
        wanted = _shortened(wanted, tuning.fastest)
        turn, angle, away = np.zeros(3), 0.0, 0.0
        if self._turns:
            whole = rotation_vector(rotation @ state.rotation.T)
            away = _length(whole)
            if turns:
                askew = _shortened(whole, tuning.widest)
                angle = min(away, tuning.widest)
                turn = _shortened(tuning.gain * askew + (0.0 if spin is None else spin), tuning.quickest)
        # A goal that cannot be reached leaves an error, whose curvature a step of least squares does not know: the step
        # would be too long, and the joints would swing. Damping by the error bounds it (Sugihara 2011), and vanishes as
        # a goal that can be reached is approached.
        part = tuning.gain * (seconds + self._ramp / 2)  # the time in which a rate follows what is solved here
        speeds = [wanted, turn][: len(prepared.order.tasks)]
        residuals = [part * tuning.bend * min(missing, tuning.longest), part * angle]
        del residuals[len(speeds) :]
        if tuning.turns_first:
            speeds.reverse()
            residuals.reverse()
        rates, limited, bind = self._within(prepared, speeds, residuals)
        rates, more = gaps.apart(rates)
        near = tuple(dict.fromkeys(gaps.what[number] for number in (*bind, *more)))
        ratio = max(map(abs, (rates / self._rates).tolist())) if share > 0.0 else math.inf
        rates = rates * (min(1.0, share / ratio) if ratio > 0.0 else 1.0)
        if before is not None:
            last, most = np.array(before), self._accelerations * seconds
            rates = gaps.changed(rates, last - most, last + most, last * max(0.0, 1.0 - seconds / self._ramp))
        after = here + clipped(rates, prepared.slowest, prepared.fastest) * seconds
        after = clipped(after, prepared.lowest, prepared.highest)
        made = tuple(((after - here) / seconds).tolist())
        return Solution(tuple(after.tolist()), made, limited, near, missing, away)

    def _speeds(self, here: Array) -> tuple[Array, Array]:
        """Return each joint's range of speeds: slower near the end of its range, and only inwards beyond it."""
        gain = self._tuning.limit_gain
        slowest = clipped(gain * (self._lower - here), -self._rates, 0.0)
        fastest = clipped(gain * (self._upper - here), 0.0, self._rates)
        return slowest, fastest

    def _near(self, here: Array, state: ChainState, before: Sequence[float] | None) -> GapLimits:
        """Return what is near, the nearest last.

        What comes fast is near from further away: joints need time to become slower.
        """
        tuning = self._tuning
        ahead = None if before is None or not any(before) else np.array(before) / tuning.limit_gain
        found = self._keeps_off.gaps(here, state, tuning.safe, ahead)
        return gap_limits(found, len(self._rates), tuning.limit_gain, tuning.close)

    def _within(
        self, prepared: Prepared, speeds: Sequence[Array], residuals: Sequence[float]
    ) -> tuple[Array, tuple[int, ...], list[int]]:
        """Solve; what would pass a bound set by a range or a gap keeps to it, and the other joints solve anew.

        `speeds`, `residuals`: of the tasks in their order. Return the rates, the joints at the ends of their ranges,
        and the gaps that bind.
        """
        here, gaps, slowest, fastest = prepared.here, prepared.gaps, prepared.slowest, prepared.fastest
        order = prepared.order
        free = np.ones(len(here), dtype=bool)
        held = np.zeros(len(here))
        limited: list[int] = []
        bind: list[int] = []
        rates = held
        pull = None if self._posture is None else self._tuning.posture * (self._posture - here)
        for _ in range((len(here) + 1) * (MOST_GAPS + 1)):
            if limited or bind:
                order = self._order(prepared.state, free, gaps, bind)
            rates = held + order.rates(speeds, residuals, held, pull)
            beyond = free & (
                ((rates > fastest) & (fastest < self._rates)) | ((rates < slowest) & (slowest > -self._rates))
            )
            if beyond.any():
                excess = np.where(beyond, np.maximum(rates - fastest, slowest - rates) / self._rates, 0.0)
                worst = int(np.argmax(excess))
                held[worst] = fastest[worst] if rates[worst] > 0.0 else slowest[worst]
                free[worst] = False
                limited.append(worst)
            elif len(bind) < min(MOST_GAPS, int(free.sum())) and (gap := gaps.narrowed(rates, bind)) is not None:
                bind.append(gap)
                free[:], held[:] = True, 0.0  # which joints pass a bound may be others now
                limited.clear()
            else:
                break
        if not limited:
            return rates, (), bind
        ended = np.minimum(here - self._lower, self._upper - here) < self._tuning.end
        return rates, tuple(number for number in limited if ended[number]), bind

    def _order(self, state: ChainState, free: Array, gaps: GapLimits, bind: list[int]) -> TaskOrder:
        """Return the tasks for the free joints, after the gaps that bind."""
        tuning = self._tuning
        jacobians = [(state.linear, Damping(tuning.small_linear, tuning.damping_linear))]
        if self._turns:
            jacobians.append((state.angular, Damping(tuning.small_angular, tuning.damping_angular)))
        if tuning.turns_first:
            jacobians.reverse()
        return task_order(jacobians, free, gaps.gradients[bind], gaps.most[bind], gaps.steep[bind])


def _length(vector: Array) -> float:
    return math.sqrt(vector @ vector)


def _shortened(vector: Array, longest: float) -> Array:
    length = _length(vector)
    return vector if length <= longest else vector * (longest / length)
