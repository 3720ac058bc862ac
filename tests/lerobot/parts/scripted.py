"""A leader of the tests behind LeRobot's Teleoperator class, as nobody's hand is here: it moves by the clock, or so far
with each action.
"""

import math
import time
from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator

__all__ = ["Scripted", "ScriptedConfig"]


@TeleoperatorConfig.register_subclass("scripted")
@dataclass(kw_only=True)
class ScriptedConfig(TeleoperatorConfig):
    swing: float = 15.0  # degrees
    period: float = 4.0  # s
    steps: int = 0  # actions of one period, whenever they are asked for; 0: the clock counts


class Scripted(Teleoperator):
    config_class = ScriptedConfig
    name = "scripted"

    def __init__(self, config: ScriptedConfig) -> None:
        super().__init__(config)
        self.config = config
        self._began: float | None = None
        self._asked = 0

    @property
    def action_features(self) -> dict[str, Any]:
        return {"pan.pos": float, "lift.pos": float, "gripper.pos": float}

    @property
    def feedback_features(self) -> dict[str, Any]:
        return {}

    @property
    def is_connected(self) -> bool:
        return self._began is not None

    @property
    def is_calibrated(self) -> bool:
        return True

    def connect(self, calibrate: bool = True) -> None:
        self._began = time.monotonic()

    def calibrate(self) -> None:
        pass

    def configure(self) -> None:
        pass

    def _turn(self) -> float:
        """From -1 to 1."""
        assert self._began is not None
        self._asked += 1
        by_clock = (time.monotonic() - self._began) / self.config.period
        return math.sin((self._asked / self.config.steps if self.config.steps else by_clock) * math.tau)

    def get_action(self) -> dict[str, float]:
        turn = self._turn()
        return {
            "pan.pos": 10.0 + self.config.swing * turn,
            "lift.pos": -20.0 + self.config.swing * turn,
            "gripper.pos": 50.0 + 30.0 * turn,
        }

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        pass

    def disconnect(self) -> None:
        self._began = None
