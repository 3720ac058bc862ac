"""A leader for an SO-101. LeRobot looks for a device's class in the module of its name, in lower case."""

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators.config import TeleoperatorConfig

from tests.lerobot.parts.scripted import Scripted, ScriptedConfig

__all__ = ["ScriptedSo101", "ScriptedSo101Config"]


@TeleoperatorConfig.register_subclass("scripted_so101")
@dataclass(kw_only=True)
class ScriptedSo101Config(ScriptedConfig):
    pass


class ScriptedSo101(Scripted):
    """Leads an SO-101 in degrees, from where the simulated one begins."""

    config_class = ScriptedSo101Config
    name = "scripted_so101"
    home = {
        "shoulder_pan.pos": 0.0,
        "shoulder_lift.pos": -31.5,
        "elbow_flex.pos": 17.2,
        "wrist_flex.pos": 88.8,
        "wrist_roll.pos": 0.0,
        "gripper.pos": 25.0,
    }

    @property
    def action_features(self) -> dict[str, Any]:
        return dict.fromkeys(self.home, float)

    def get_action(self) -> dict[str, float]:
        return self.home | {"shoulder_pan.pos": self.config.swing * self._turn()}
