"""The common part of the robot and the teleoperator: each has a process of Lockstep."""

from typing import Any

from lerobot.utils.errors import DeviceNotConnectedError

from lerobot_robot_lockstep.config import link_of, python_of
from lerobot_robot_lockstep.pipe import Pipe

__all__ = ["LockstepDevice"]


class LockstepDevice:
    """Has a process of Lockstep, and nothing to calibrate or to configure: the robot's own side does both.

    Inherit it before LeRobot's class, whose abstract members it has.
    """

    config: Any

    def __init__(self, config: Any) -> None:
        super().__init__(config)  # type: ignore[call-arg]  # LeRobot's class
        self.config = config
        self._pipe: Pipe | None = None
        self._known: dict[str, Any] | None = None
        self._connected = False

    @property
    def is_connected(self) -> bool:
        return self._connected and self._pipe is not None and self._pipe.alive

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        """There is nothing to calibrate."""

    def configure(self) -> None:
        """There is nothing to configure."""

    def _live(self) -> Pipe:
        if not self.is_connected or self._pipe is None:
            raise DeviceNotConnectedError
        return self._pipe

    def _console(self) -> Pipe:
        """Return the process with the client of the console; begin it if there is none that answers."""
        if self._pipe is None or not self._pipe.alive:
            self._let_go()  # one that does not answer may hold the seat
            self._pipe = Pipe(python_of(self.config.python), "lockstep.client.pipe")
        return self._pipe

    def _ask_console(self, name: str, **wishes: Any) -> dict[str, Any]:
        """Return what the console says of the robot. `name`: of this participant; `wishes`: more for `open`."""
        pipe = self._console()
        if self._known is None:
            config = self.config
            self._known, _ = pipe.ask(
                "open",
                config.connect_timeout_s,
                link=link_of(config.link),
                name=name,
                tls_ca=config.tls_ca,
                connect_seconds=config.connect_timeout_s,
                **wishes,
            )
        return self._known

    def _let_go(self) -> None:
        """End the process in order, if there is one."""
        self._connected = False
        pipe, self._pipe, self._known = self._pipe, None, None
        if pipe is not None:
            pipe.close()
