"""LeRobot's Robot class for a robot behind a Lockstep console."""

from functools import cached_property
from typing import Any

import numpy as np
from lerobot.robots import Robot
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from lerobot_robot_lockstep.config import LockstepRobotConfig
from lerobot_robot_lockstep.device import LockstepDevice
from lerobot_robot_lockstep.pipe import Pipe

__all__ = ["LockstepRobot"]

COMMAND_SECONDS = 10.0  # for one command and its feedback on a bad network


class LockstepRobot(LockstepDevice, Robot):
    """Drives the robot as one more client of its console, with the seat, one event each; or only watches it.

    A picture that the console's gate would refuse never becomes part of an observation.
    """

    config_class = LockstepRobotConfig
    name = "lockstep"

    # The robot's features; the first one that is read asks the console

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        return {
            **{axis["name"]: float for axis in self._description()["axes"]},
            **{camera["name"]: (camera["height"], camera["width"], 3) for camera in self._description()["cameras"]},
        }

    @cached_property
    def action_features(self) -> dict[str, type]:
        return {axis["name"]: float for axis in self._description()["axes"] if axis.get("action", True)}

    @property
    def cameras(self) -> dict[str, Any]:
        """The cameras by name: LeRobot counts them for its image writers."""
        return {camera["name"]: camera for camera in self._description()["cameras"]}

    # Driving

    def connect(self, calibrate: bool = True) -> None:
        """Take the seat, unless `drive` is off, and wait for a first observation.

        Raises:
            LockstepError: the seat is taken, the robot is stopped, …
            NoFreshObservation: no state and pictures that belong together came in time.
        """
        if self.is_connected:
            raise DeviceAlreadyConnectedError
        self._description()
        pipe = self._console()
        try:
            if self.config.drive:
                pipe.ask("take_seat", COMMAND_SECONDS)
            self._observe(pipe, max(self.config.observation_timeout_s, self.config.connect_timeout_s))
        except BaseException:
            self._let_go()  # after a refusal the seat is free
            raise
        self._connected = True

    def get_observation(self) -> dict[str, Any]:
        """Return the measured axes and a picture of each camera, of the same event within the tolerance.

        Raises:
            NoFreshObservation: none came within `observation_timeout_s`.
            DeviceNotConnectedError: the connection ended.
        """
        return self._observe(self._live(), self.config.observation_timeout_s)

    def send_action(self, action: dict[str, Any]) -> dict[str, float]:
        """Send one event and return what was sent: a goal further away than the robot takes is bounded first.

        Raises:
            LockstepError: the robot is stopped, the seat is gone, … Nothing is tried again by itself.
            DeviceNotConnectedError: the connection ended.
        """
        pipe = self._live()
        values = {name: float(value) for name, value in action.items()}
        if not self.config.drive:
            return values  # a person drives
        answer, _ = pipe.ask("drive", COMMAND_SECONDS, values=values, wait=self.config.wait)
        return {name: float(value) for name, value in answer["sent"].items()}

    def disconnect(self) -> None:
        """Bring the robot to rest, give the seat back and end the connection."""
        if self._pipe is None:
            raise DeviceNotConnectedError
        self._let_go()

    def _observe(self, pipe: Pipe, seconds: float) -> dict[str, Any]:
        answer, blocks = pipe.ask("observe", seconds, seconds=seconds, max_age=self.config.picture_age_s)
        observed: dict[str, Any] = dict(answer["values"])
        for camera, block in zip(self._description()["cameras"], blocks, strict=True):
            observed[camera["name"]] = np.frombuffer(block, np.uint8).reshape(camera["height"], camera["width"], 3)
        return observed

    def _description(self) -> dict[str, Any]:
        """Return what the console says of the robot."""
        config = self.config
        return self._ask_console(config.id or "lerobot", tolerance=config.tolerance, pictures=config.pictures)
