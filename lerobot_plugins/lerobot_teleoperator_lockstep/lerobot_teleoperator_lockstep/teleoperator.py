"""LeRobot's Teleoperator class for a person at Lockstep's page."""

from functools import cached_property
from typing import Any

from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from lerobot_robot_lockstep.config import python_of
from lerobot_robot_lockstep.device import LockstepDevice
from lerobot_robot_lockstep.pipe import Pipe

from lerobot_teleoperator_lockstep.config import LockstepTeleoperatorConfig

__all__ = ["LockstepTeleoperator"]

ANSWER_SECONDS = 5.0


class LockstepTeleoperator(LockstepDevice, Teleoperator):
    """Returns the applied goals: what the robot is told, after every limit. When nobody drives, they stand still."""

    config_class = LockstepTeleoperatorConfig
    name = "lockstep"

    def __init__(self, config: LockstepTeleoperatorConfig) -> None:
        super().__init__(config)
        self.address = ""  # of the bridge, with "page"

    @cached_property
    def action_features(self) -> dict[str, type]:
        if self.config.source == "page":
            return dict.fromkeys(self.config.axes, float)
        return {axis["name"]: float for axis in self._session()["axes"] if axis.get("action", True)}

    @property
    def feedback_features(self) -> dict[str, Any]:
        return {}

    def connect(self, calibrate: bool = True) -> None:
        """Connect to the session, or begin to listen for a console.

        Raises:
            LockstepError: the console says no, or the address cannot be had.
        """
        if self.is_connected:
            raise DeviceAlreadyConnectedError
        if self.config.source == "session":
            self._session()
        else:
            self._let_go()  # a process that has ended, or does not answer
            self._listen()
        self._connected = True

    def get_action(self) -> dict[str, float]:
        """Return the applied goal of each axis; of a rate axis the measured rate.

        Raises:
            LockstepError: the robot's state is not known.
            DeviceNotConnectedError: the connection ended.
        """
        pipe = self._live()
        if self.config.source == "page":
            answer, _ = pipe.ask("action", ANSWER_SECONDS)
            return {name: float(value) for name, value in answer["values"].items()}
        seconds = self.config.observation_timeout_s
        answer, _ = pipe.ask("observe", seconds, seconds=seconds)
        measured, goals = answer["values"], answer["goals"]
        return {name: float(measured[name] if goals[name] is None else goals[name]) for name in self.action_features}

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """A page takes no feedback of LeRobot: it has its robot's own."""
        raise NotImplementedError

    def disconnect(self) -> None:
        """End the connection, or the bridge."""
        if self._pipe is None:
            raise DeviceNotConnectedError
        self._let_go()

    def _session(self) -> dict[str, Any]:
        """Return what the console says of the robot."""
        return self._ask_console(f"{self.config.id or 'lerobot'} (actions)", pictures=False)

    def _listen(self) -> None:
        config = self.config
        module = "lockstep.robot_bridge.robots.lerobot.teleoperator_process"
        pipe = Pipe(python_of(config.python), module)
        try:
            answer, _ = pipe.ask(
                "open",
                config.connect_timeout_s,
                axes=config.axes,
                start=config.start,
                host=config.host,
                port=config.port,
            )
        except BaseException:
            pipe.close()
            raise
        self._pipe, self.address = pipe, str(answer["robot"])
