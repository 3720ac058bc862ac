"""Lockstep's page as a teleoperator for LeRobot's own commands: --teleop.type=lockstep. See docs/lerobot.md."""

from lerobot_teleoperator_lockstep.config import LockstepTeleoperatorConfig
from lerobot_teleoperator_lockstep.teleoperator import LockstepTeleoperator

__all__ = ["LockstepTeleoperator", "LockstepTeleoperatorConfig"]
