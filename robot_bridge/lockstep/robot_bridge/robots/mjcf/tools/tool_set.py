"""All tools of a model: what they add to the robot's axes, and to its values."""

from collections.abc import Collection, Sequence
from typing import Any

from lockstep.protocol.description import Axis, Body, ControlLayer, Pose
from lockstep.robot_bridge.robots.mjcf.drives import Drive
from lockstep.robot_bridge.robots.mjcf.tools.tool_parts import ToolParts, tool_parts
from lockstep.robot_bridge.robots.mjcf.tools.tool_setting import ModelTool

__all__ = ["ToolSet"]


class ToolSet:
    """The tools. Their values follow those of the drives.

    Attributes:
        axes, bodies, poses, layers: for the description
    """

    def __init__(
        self, model: Any, data: Any, tools: Sequence[ModelTool], drives: Sequence[Drive], bodies: Sequence[Body]
    ) -> None:
        """`bodies`: of the description. `data` has the model's first posture."""
        self._data = data
        self._parts: list[ToolParts] = []
        self.axes: tuple[Axis, ...] = ()
        for tool in tools:
            parts = tool_parts(model, data, tool, drives, bodies, len(drives) + len(self.axes))
            self._parts.append(parts)
            self.axes += parts.axes
        self.bodies: tuple[Body, ...] = tuple(each.body for each in self._parts)
        self.poses: tuple[Pose, ...] = tuple(each.pose for each in self._parts)
        self.layers: tuple[ControlLayer, ...] = tuple(each.layer for each in self._parts)

    @property
    def faults(self) -> list[str]:
        return [fault for each in self._parts for fault in each.tool.faults]

    def measured(self) -> list[float]:
        """Return the values of the tools' axes where the joints are now."""
        return [value for each in self._parts for value in each.tool.pose_at(self._joints(each))]

    def put_pursued(self, values: list[float]) -> None:
        """Put the goals of the joints, and the poses at them, in the place of the values of all axes."""
        for each in self._parts:
            each.tool.put_pursued(values)

    def drive(self, values: Sequence[float], seconds: float, since: float, pursued: Collection[str]) -> None:
        """Take the values of all axes for the coming `seconds`.

        `since`: s since the call before. `pursued`: names of the poses that commands drive.
        """
        for each in self._parts:
            each.tool.drive(values, seconds, since, self._joints(each), pursues=each.tool.name in pursued)

    def prepare(self) -> None:
        """Compute what the next `drive` needs of the joints alone."""
        for each in self._parts:
            each.tool.prepare()

    def hold(self) -> None:
        """Stay where the goals are until the values change."""
        for each in self._parts:
            each.tool.hold()

    def restart(self, *, measured: bool = False) -> None:
        """Stay where the goals are, or where the joints are measured, whatever the next values are."""
        for each in self._parts:
            each.tool.restart(self._joints(each) if measured else None)

    def _joints(self, parts: ToolParts) -> list[float]:
        return [float(self._data.qpos[index]) for index in parts.joints]
