"""A clutch between an operator's device and goal axes: engaging moves nothing, then the goals follow the device.

docs/robot-link.md, "The clutch"; the cases in tests/vectors/clutch.json hold for the page's clutch too.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.protocol.serial import event_after

__all__ = ["REACH_SHARE", "Clutch"]

REACH_SHARE = 0.8  # of an axis' reach that goals use: the robot moves on while a command travels


@dataclass
class _Bound:
    """One axis. Places of an axis with `wrap` are counted on past its period, so that a turn keeps its direction."""

    index: int  # in the description's axes
    axis: Axis
    scale: float  # goal per device motion; negative: mirrored
    origin: float = 0.0  # the applied goal at which it was engaged
    device: float = 0.0  # newest reading
    motion: float = 0.0  # of the device since it was engaged
    measured: float = 0.0
    applied: float = 0.0

    def bind(self, device: float, goal: float, measured: float) -> None:
        self.origin, self.device, self.motion = goal, device, 0.0
        self.applied, self.measured = goal, goal + self._shorter(measured - goal)

    def observe(self, goal: float, measured: float) -> None:
        self.measured += self._shorter(measured - self.measured)
        self.applied = self.measured + self._shorter(goal - self.measured)

    def goal(self, device: float) -> tuple[float, bool]:
        """Return the goal, and whether it was clipped."""
        self.motion += self._shorter(device - self.device)
        self.device = device
        wanted = self.origin + self.scale * self.motion
        # The applied goal is inside even if a load has moved the robot far from it: engaging must move nothing.
        least = min(self.measured - REACH_SHARE * self.axis.reach, self.applied)
        most = max(self.measured + REACH_SHARE * self.axis.reach, self.applied)
        goal = min(max(wanted, least), most)
        return goal, goal != wanted

    def _shorter(self, difference: float) -> float:
        return difference if self.axis.wrap is None else math.remainder(difference, self.axis.wrap)


class Clutch:
    """Binds device positions to goal axes. It holds no clock and no connection: hand it each feedback and each reading.

    `observe` every feedback, `engage` when the operator asks for it, and drive what `values` returns. The first goal is
    the applied goal of the newest feedback, whatever the device's position is. From then on a goal is that place plus
    the device's own motion since, times the axis' scale. A goal further than 0.8 of the axis' reach from the newest
    measured value is clipped there, and `clipped` says so; the device's motion counts on meanwhile.

    It engages only while the goals of its axes stand still: a goal that still brakes, or a pose that has not settled,
    is not where the robot comes to rest. Nor does it engage while a goal that it gave before may be under way: that
    is until the second event after the feedback for which it gave that goal. `waits` says that engaging again can
    succeed after another command, such as a neutral one.

    Call `release` when the operator lets go, and when the feedback, the seat or the arming is lost. The clutch releases
    itself when a reading is None or not finite, and when the robot needs a neutral command. Then the values are None,
    and it has to be engaged anew.

    Args:
        description: the robot's
        scales: goal axes by name, in the order of the readings, with the goal per device motion in axis units;
            negative for a mirrored joint

    Raises:
        ValueError: no axis of this name, no goal axis, or a scale that is not finite.
    """

    def __init__(self, description: RobotDescription, scales: Mapping[str, float]) -> None:
        indices = {axis.name: index for index, axis in enumerate(description.axes)}
        unknown = [name for name in scales if name not in indices or description.axes[indices[name]].kind != "goal"]
        if unknown:
            raise ValueError(f"no goal axis {', '.join(unknown)}")
        if not all(math.isfinite(scale) for scale in scales.values()):
            raise ValueError("a scale is NaN or infinite")
        self._axes = len(description.axes)
        self._bound = [_Bound(indices[name], description.axes[indices[name]], scale) for name, scale in scales.items()]
        settling = {name: pose.settling for pose in description.poses for name in (*pose.position, *pose.rotation)}
        self._settling = max((settling.get(name, 0.0) for name in scales), default=0.0)  # s
        self._newest: Feedback | None = None
        self._given: int | None = None  # event of the feedback for which it gave a goal last
        self._stood_at = 0.0  # robot's time of the first feedback with the goals of the newest one
        self._waits = False
        self._engaged = False
        self._clipped: tuple[str, ...] = ()

    @property
    def engaged(self) -> bool:
        """Whether the goals follow the device."""
        return self._engaged

    @property
    def waits(self) -> bool:
        """Whether it was not engaged only because the goals do not stand still yet, or one may be under way."""
        return self._waits

    @property
    def clipped(self) -> tuple[str, ...]:
        """The axes whose newest goal is nearer than the device asks for."""
        return self._clipped

    def observe(self, feedback: Feedback) -> None:
        """Take the newest feedback: measured values and applied goals. Not enough of them counts as lost feedback."""
        if not self._usable(feedback):
            self.lost_feedback()
            return
        if self._newest is None or self._goals_of(feedback) != self._goals_of(self._newest):
            self._stood_at = feedback.time
        self._newest = feedback
        if self._engaged:
            for bound in self._bound:
                goal = feedback.goals[bound.index]
                assert goal is not None  # `_usable`
                bound.observe(goal, feedback.axes[bound.index])

    def engage(self, device: Sequence[float | None]) -> bool:
        """Bind the device's position to the newest feedback's applied goals. Engaged already, it binds anew.

        Args:
            device: one reading per axis of the clutch, in the axes' units before the scale; None: not known

        Returns:
            Whether it is engaged: not without a feedback, not while the robot needs a neutral command, not with a
            reading that is not known, and not before the goals stand still and none is under way (`waits`).

        Raises:
            ValueError: not one reading per axis.
        """
        self.release()
        readings = self._readings(device)
        if readings is None or self._newest is None:
            return False
        self._waits = self._is_under_way(self._newest) or not self._stands(self._newest)
        if self._waits:
            return False
        for bound, reading in zip(self._bound, readings, strict=True):
            goal = self._newest.goals[bound.index]
            assert goal is not None  # `_usable`
            bound.bind(reading, goal, self._newest.axes[bound.index])
        self._engaged = True
        return True

    def goals(self, device: Sequence[float | None]) -> list[float | None]:
        """Return one goal per axis of the clutch for the newest readings; None for each unless it is engaged.

        Args:
            device: as for `engage`

        Raises:
            ValueError: not one reading per axis.
        """
        readings = self._readings(device)
        if readings is None:
            self.release()
        if readings is None or not self._engaged or self._newest is None:
            return [None] * len(self._bound)
        self._given = self._newest.event
        found = [bound.goal(reading) for bound, reading in zip(self._bound, readings, strict=True)]
        self._clipped = tuple(
            bound.axis.name for bound, (_, clipped) in zip(self._bound, found, strict=True) if clipped
        )
        return [goal for goal, _ in found]

    def values(self, device: Sequence[float | None]) -> dict[str, float | None]:
        """Return `goals` by the axes' names, as `Console.drive` takes them."""
        return dict(zip((bound.axis.name for bound in self._bound), self.goals(device), strict=True))

    def release(self) -> None:
        """Let go: the values are None until it is engaged anew, anywhere."""
        self._engaged = self._waits = False
        self._clipped = ()

    def lost_feedback(self) -> None:
        """Release, and do not engage before another feedback.

        The newest one may be of another state, or of another run of the robot bridge.
        """
        self.release()
        self._newest = self._given = None

    def _is_under_way(self, newest: Feedback) -> bool:
        """Return whether a goal from before it was released may execute after this feedback.

        It left in the command after its feedback, or, made ready before its turn, in the one after that.
        """
        return self._given is not None and newest.event in (self._given, event_after(self._given))

    def _stands(self, newest: Feedback) -> bool:
        """Return whether the goals are where the robot rests: a pose reads them anew once it has settled."""
        return newest.at_rest or newest.time - self._stood_at > self._settling

    def _goals_of(self, feedback: Feedback) -> list[float | None]:
        return [feedback.goals[bound.index] for bound in self._bound]

    def _usable(self, feedback: Feedback) -> bool:
        if feedback.neutral_needed or feedback.stop.stopped:
            return False
        if len(feedback.axes) != self._axes or len(feedback.goals) != self._axes:
            return False
        return all(feedback.goals[bound.index] is not None for bound in self._bound)

    def _readings(self, device: Sequence[float | None]) -> list[float] | None:
        if len(device) != len(self._bound):
            raise ValueError(f"{len(device)} readings for {len(self._bound)} axes")
        known = [reading for reading in device if reading is not None and math.isfinite(reading)]
        return known if len(known) == len(device) else None
