"""The arm's drive and the bridge's shaping of goals in simulated time, with an arm of a few bodies."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import msgspec
import numpy as np
import pytest

from lockstep.protocol.description import Pose
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.kinematics.pose_solver import PoseSolver
from lockstep.robot_bridge.robots.so101.arm_drive import SETTLES, ArmDrive
from lockstep.robot_bridge.robots.so101.controls import JOINT_AXES, POSITION_AXES, RATES, ROTATION_AXES
from tests.robot_bridge.kinematics.arms import BOUNDS, desk_arm

__all__ = ["AXES", "EVENT", "HOLD", "SLACK", "SLOW", "START", "TICK", "Spell", "World"]

TICK, EVENT, HOLD = 0.004, 0.04, 0.3  # s
SLOW: Final = 0.2  # of the joints' rates: an arm that the tool's goal leaves far behind
AXES = (*JOINT_AXES[:5], *POSITION_AXES, *ROTATION_AXES)
POSE = Pose(
    name="tool",
    label="Tool",
    body="hand",
    position=("tool.x", "tool.y", "tool.z"),
    rotation=("tool.rx", "tool.ry", "tool.rz"),
    instead_of=tuple(axis.name for axis in JOINT_AXES[:5]),
    settling=SETTLES,
)
START = (0.1, -0.3, 0.6, 0.7, 0.2)
SLACK = 1e-9


class Spell(NamedTuple):
    """One goal for a while."""

    drives: str  # "joints", "tool", "nothing"
    ways: tuple[float, ...]  # rad or m from where the axes are
    events: int


class World:
    """Arm and bridge in simulated time; the arm is where its goals are."""

    def __init__(self, pace: float = 1.0) -> None:
        """`pace`: of the joints, as a share of their rates."""
        rates = tuple(pace * rate for rate in RATES[:5])
        bounds = BOUNDS._replace(rates=tuple(pace * rate for rate in BOUNDS.rates))
        joints = [msgspec.structs.replace(axis, slew=pace * axis.slew) for axis in JOINT_AXES[:5]]
        self.drive = ArmDrive(desk_arm(), PoseSolver(desk_arm(), bounds), rates, START)
        self.shaper = AxisShaper([*joints, *AXES[5:]], hold=HOLD, poses=(POSE,), pursued=self.drive.pursued)
        self.shaper.begin(self.drive.pursued(), self.drive.pursued())
        self.now = 0.0
        self.executed_at = -math.inf
        self.values: list[float] = []
        self.way: list[tuple[float, ...]] = [START]

    def play(self, spell: Spell) -> None:
        here = self.drive.pursued()
        numbers = {"joints": range(5), "tool": range(5, 11), "nothing": range(0)}[spell.drives]
        goals = [here[number] + spell.ways[number] if number in numbers else None for number in range(len(AXES))]
        for _ in range(spell.events):
            if spell.drives != "nothing":
                self.command(goals)
            self.wait(EVENT)

    def command(self, goals: Sequence[float | None], speed: float = 1.0) -> None:
        self.shaper.drive(goals, self.now, speed)
        self.executed_at = self.now

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            self.tick(TICK)

    def tick(self, since: float, *, held_up: bool = False) -> None:
        """`since`: s since the tick before, in which nothing moved. `held_up`: the bridge has seen that it was long."""
        self.now += since - TICK
        self.values = self.shaper.step(self.now, TICK)
        if held_up:  # what `CommandExecutor` does then
            self.shaper.take_back()
            self.shaper.cut()
            self.drive.hold()
            self.values = self.shaper.values
        before = self.drive.goals
        rates = self.drive.drive(self.values, TICK, since, pursues=bool(self.shaper.pursued_poses))
        assert self.drive.goals == pytest.approx(np.array(before) + np.array(rates) * TICK, abs=SLACK)
        self.way.append(self.drive.goals)
        self.now += TICK
