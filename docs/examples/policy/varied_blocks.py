"""The SO-101, whose red block lies elsewhere after each `reset_scene`, and which says where.

    PYTHONPATH=docs/examples/policy lockstep up --robot varied_blocks:VariedBlocks

It says the block's place as its status, as a robot does whose camera finds a marker. The other blocks are put aside.
"""

import math
import os
import random
from collections.abc import Mapping, Sequence
from typing import Final

from lockstep.protocol.actions import ParameterValue, StatusItem
from lockstep.robot_bridge.robots.actions import ActionRun
from lockstep.robot_bridge.robots.mujoco_view.graphics import choose_graphics
from lockstep.robot_bridge.robots.so101.model_source import arm_file

choose_graphics()  # before mujoco is imported

from lockstep.robot_bridge.robots.so101.robot import So101  # noqa: E402

__all__ = ["VariedBlocks"]

BLOCK: Final = "red_block"
ASIDE: Final = {"green_block": (-0.10, 0.30, 0.014), "blue_block": (-0.10, -0.30, 0.014)}  # m
PAN: Final = 0.0388  # m, x of the axis about which the arm pans
DISTANCES: Final = (0.16, 0.26)  # m, of the block from that axis
BEARINGS: Final = (-0.9, 0.1)  # rad, left of straight ahead
TURNED: Final = 0.4  # rad, of a side of the block from where it faces the arm, at most


class VariedBlocks(So101):
    def __init__(self) -> None:
        super().__init__(arm_file(os.environ))
        self._random = random.Random(os.environ.get("BLOCKS_SEED", "1"))
        self._scene = 0  # how often the scene was reset
        self._vary()

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        run = super().begin_action(name, parameters)
        if name == "reset_scene":
            self._vary()
        return run

    def status(self) -> Sequence[StatusItem]:
        x, y, _ = self.simulation.place(BLOCK).tolist()
        found = {"block_x": x, "block_y": y, "block_turn": self.simulation.turn(BLOCK), "scene": float(self._scene)}
        items = (StatusItem(name=name, label=name, kind="number", value=round(each, 4)) for name, each in found.items())
        return (*super().status(), *items)

    def _vary(self) -> None:
        self._scene += 1
        distance, bearing = self._random.uniform(*DISTANCES), self._random.uniform(*BEARINGS)
        place = (PAN + distance * math.cos(bearing), distance * math.sin(bearing), 0.014)
        self.simulation.put(BLOCK, place, bearing + self._random.uniform(-TURNED, TURNED))
        for body, aside in ASIDE.items():
            self.simulation.put(body, aside, 0.0)
