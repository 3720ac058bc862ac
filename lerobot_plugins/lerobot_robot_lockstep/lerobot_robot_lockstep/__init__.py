"""A robot behind a Lockstep console, for LeRobot's own commands: --robot.type=lockstep. See docs/lerobot.md."""

from lerobot_robot_lockstep.config import LockstepRobotConfig
from lerobot_robot_lockstep.errors import LockstepError, LockstepLost, NoFreshObservation
from lerobot_robot_lockstep.robot import LockstepRobot

__all__ = ["LockstepError", "LockstepLost", "LockstepRobot", "LockstepRobotConfig", "NoFreshObservation"]
