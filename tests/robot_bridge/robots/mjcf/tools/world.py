"""A model's arm behind the bridge's shaping of goals, in simulated time. The arm is where its goals are."""

from collections.abc import Mapping
from typing import Any, Final

import mujoco
import numpy as np

from lockstep.protocol.description import Axis
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.robots.mjcf.actuators import actuators_of
from lockstep.robot_bridge.robots.mjcf.bodies import bodies_of
from lockstep.robot_bridge.robots.mjcf.drives import drives_of
from lockstep.robot_bridge.robots.mjcf.joints import joints_of
from lockstep.robot_bridge.robots.mjcf.tools.tool_parts import ToolParts, tool_parts
from lockstep.robot_bridge.robots.mjcf.tools.tool_setting import tools_of

__all__ = ["EVENT", "HOLD", "TICK", "World", "parts_in"]

TICK, EVENT, HOLD = 0.004, 0.04, 0.3  # s
SLACK: Final = 1e-9


def parts_in(text: str) -> tuple[ToolParts, list[Axis]]:
    """Return the first tool of a model, and all axes."""
    model: Any = mujoco.MjModel.from_xml_string(text)
    data: Any = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    actuators = actuators_of(model)
    (tool,) = tools_of(model, actuators)
    drives = drives_of(model, data, actuators, {servo.number for servo in tool.servos})
    parts = tool_parts(model, data, tool, drives, bodies_of(model, joints_of(model)), len(drives))
    return parts, [*(drive.axis for drive in drives), *parts.axes]


class World:
    """Plays commands. Every tick is checked: no joint's goal passes its rate or its range.

    Attributes:
        way: the joints' goals after each tick
    """

    def __init__(self, text: str) -> None:
        self.parts, self.axes = parts_in(text)
        self.tool = self.parts.tool
        self.names = [axis.name for axis in self.axes]
        self.joints = [self.axes[number] for number in self.tool.place.joints]
        self._shaper = AxisShaper(self.axes, hold=HOLD, poses=(self.parts.pose,), pursued=self.pursued)
        self._shaper.begin(self.pursued(), self.pursued())
        self._now = 0.0
        self.way = [self.tool.goals]

    def pursued(self) -> list[float]:
        goals = [0.0] * len(self.axes)
        self.tool.put_pursued(goals)
        return goals

    def value(self, word: str) -> float:
        """Return where an axis of the tool is."""
        return self.pursued()[self.names.index(f"{self.tool.name}.{word}")]

    def command(self, values: Mapping[str, float], events: int = 1) -> None:
        """Repeat a command; the axes that it does not name stay."""
        for _ in range(events):
            self._shaper.drive([values.get(name) for name in self.names], self._now)
            self.wait(EVENT)

    def approach(self, values: Mapping[str, float], events: int) -> None:
        """Command a tool as a person does: its goal is to and fro by a little, so that the arm does not settle."""
        for number in range(events):
            x = f"{self.tool.name}.x"
            self.command({**values, x: values[x] + 1e-4 * (number % 2)})

    def wait(self, seconds: float) -> None:
        """Let ticks pass; nothing is commanded."""
        for _ in range(round(seconds / TICK)):
            values = self._shaper.step(self._now, TICK)
            self.tool.drive(values, TICK, TICK)
            self._check(self.way[-1], self.tool.goals)
            self.way.append(self.tool.goals)
            self._now += TICK

    def fastest_change(self) -> float:
        """Return the largest change of a joint's rate in one tick, as a share of its full rate."""
        rates = np.diff(np.array(self.way), axis=0) / TICK / [4 / 3 * axis.slew for axis in self.joints]
        return float(np.abs(np.diff(rates, axis=0)).max())

    def _check(self, before: tuple[float, ...], after: tuple[float, ...]) -> None:
        for axis, old, new in zip(self.joints, before, after, strict=True):
            assert abs(new - old) <= 4 / 3 * axis.slew * TICK + SLACK
            assert axis.minimum - SLACK <= new <= axis.maximum + SLACK
