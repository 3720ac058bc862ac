"""A leader of the tests behind LeRobot's Teleoperator class: it moves by the clock, as nobody's hand is here."""

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


class Scripted(Teleoperator):
    config_class = ScriptedConfig
    name = "scripted"

    def __init__(self, config: ScriptedConfig) -> None:
        super().__init__(config)
        self.config = config
        self._began: float | None = None

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

    def get_action(self) -> dict[str, float]:
        assert self._began is not None
        turn = math.sin((time.monotonic() - self._began) / self.config.period * math.tau)
        return {
            "pan.pos": 10.0 + self.config.swing * turn,
            "lift.pos": -20.0 + self.config.swing * turn,
            "gripper.pos": 50.0 + 30.0 * turn,
        }

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        pass

    def disconnect(self) -> None:
        self._began = None
