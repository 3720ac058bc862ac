"""The goals of an arm's joints, which their own axes drive, or the pose of its tool. No I/O, no clock."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.control.limits.goal_axis import shorter_way
from lockstep.robot_bridge.robots.ros2.settings import Arm
from lockstep.robot_bridge.robots.ros2.tool import arm_tool
from lockstep.robot_bridge.robots.tool_pose.joint_follower import JointFollower
from lockstep.robot_bridge.robots.tool_pose.posed_tool import PosedTool

__all__ = ["ArmGoals"]

Array = npt.NDArray[np.float64]
MOVED = 0.05  # rad or m: an arm at rest that is further than that from its goal was moved by something else
FOLLOWS = 0.002  # rad or m, by which it may go on then before its goal follows again: a joint's reading is not steadier


class ArmGoals:
    """Begins where the arm is measured first. Values are those of the arm's axes: the joints', then the tool's.

    Attributes:
        goals: rad or m, of the joints, in the order of the settings
    """

    def __init__(self, settings: Arm, description: RobotDescription, measured: Sequence[float]) -> None:
        self._tool: PosedTool | None = None
        if settings.tool is not None:
            self._tool = arm_tool(settings, description, measured)
        posed = () if self._tool is None else self._tool.place.joints
        others = [number for number in range(len(settings.joints)) if number not in posed]
        rates = [settings.joints[number].maximum for number in others]
        self._others = JointFollower(others, rates, [measured[number] for number in others])
        self._grips = [number for number in others if settings.joints[number].grips]
        axes = {axis.name: axis for axis in description.axes}
        self._wraps = [axes[f"arm.{joint.name}"].wrap for joint in settings.joints]
        self._rested = list(measured)  # rad or m, of the joints: nearest to their goals since the arm was driven last
        self._away: set[int] = set()  # joints that something else has moved since the arm was driven, and may yet
        self._size = len(settings.joints) + (0 if self._tool is None else len(self._tool.place.pose))
        self.goals = list(measured)

    @property
    def faults(self) -> list[str]:
        return [] if self._tool is None else self._tool.faults

    def drive(
        self, values: Sequence[float], seconds: float, since: float, measured: Sequence[float], pursues: bool
    ) -> list[float]:
        """Take the applied goals; return the joints' rates for the coming `seconds`, rad/s or m/s.

        `since`: s since the call before. `measured`: of the joints. `pursues`: a command drives the tool.
        """
        rates = np.zeros(len(self.goals))
        rates[list(self._others.joints)] = self._others.drive(values, seconds)
        if self._tool is not None:
            own = list(self._tool.place.joints)
            places = [measured[number] for number in own]
            rates[own] = self._tool.drive(values, seconds, since, places, pursues=pursues)
        self._note_goals()
        if rates.any():
            self._rested = list(measured)
            self._away.clear()
        found: list[float] = rates.tolist()
        return found

    def prepare(self) -> None:
        """Compute what the next `drive` needs of the joints alone."""
        if self._tool is not None:
            self._tool.prepare()

    def hold(self) -> None:
        """Stay where the goals are until the values change."""
        self._others.hold()
        if self._tool is not None:
            self._tool.hold()

    def restart(self) -> None:
        """Stay where the goals are, whatever the next values are."""
        self._others.restart()
        if self._tool is not None:
            self._tool.restart()

    def take_up(self, measured: Sequence[float]) -> bool:
        """Begin anew where an arm at rest is, if something else has moved it away from its goals; return whether.

        From then on nothing here holds the arm, so that its goals follow it to where it comes to rest. An arm that is
        held keeps its goals: it may hang below them by MOVED, and does not go down by being driven and released.

        What a gripper holds keeps it from its goal. It begins anew only if it was moved away from its goal since it was
        driven, also during a stop, and goes on squeezing when the rest of the arm was moved.
        """
        moved = {number for number in range(len(self.goals)) if self._was_moved(number, measured[number])}
        if not moved:
            return False
        if not moved.issubset(self._grips):
            moved |= set(range(len(self.goals))).difference(self._grips)
            if self._tool is not None:
                self._tool.hold([measured[number] for number in self._tool.place.joints])
        self._others.hold([measured[n] if n in moved else self.goals[n] for n in self._others.joints])
        self._rested = list(measured)
        self._away |= moved
        self._note_goals()
        return True

    def _was_moved(self, number: int, place: float) -> bool:
        goal, rested = self.goals[number], self._rested[number]
        way = self._way(number, goal, place)
        if number in self._away:
            return way > FOLLOWS
        if number not in self._grips:
            return way > MOVED
        if not self._way(number, goal, rested) <= way:  # it goes on closing, or was not measured before
            self._rested[number] = place
            return False
        return way - self._way(number, goal, rested) > MOVED

    def _way(self, number: int, start: float, end: float) -> float:
        """Return how far it is: a joint that turns on and on may be measured a turn away from where its goal is."""
        wrap = self._wraps[number]
        return abs(end - start) if wrap is None else abs(shorter_way(start, end, wrap))

    def pursued(self) -> list[float]:
        """Return the goal of each axis: the joints', and the tool's pose at them."""
        goals = [*self.goals, *[0.0] * (self._size - len(self.goals))]
        if self._tool is not None:
            self._tool.put_pursued(goals)
        return goals

    def measured_axes(self, measured: Sequence[float]) -> list[float]:
        """Return the value of each axis where the joints are measured."""
        if self._tool is None:
            return list(measured)
        return [*measured, *self._tool.pose_at([measured[number] for number in self._tool.place.joints])]

    def _note_goals(self) -> None:
        for number, goal in zip(self._others.joints, self._others.goals, strict=True):
            self.goals[number] = goal
        if self._tool is not None:
            for number, goal in zip(self._tool.place.joints, self._tool.goals, strict=True):
                self.goals[number] = goal
