"""The interface between the adapter and a robot of LeRobot, so that the rules can be tested without LeRobot."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple, Protocol

__all__ = ["AxisFacts", "CameraFacts", "Device", "DeviceFacts", "Norm", "Shots"]

# How LeRobot normalises a motor's position: `MotorNormMode`.
Norm = Literal["degrees", "range_m100_100", "range_0_100"]


class AxisFacts(NamedTuple):
    """The robot's facts about one entry of its action."""

    name: str  # "shoulder_pan.pos"
    norm: Norm | None = None  # None: the robot does not say it
    minimum: float | None = None  # the calibrated range, in the unit of `norm`
    maximum: float | None = None
    observed: bool = True  # the observation has an entry of the same name


class CameraFacts(NamedTuple):
    name: str
    width: int
    height: int
    frame_rate: float | None  # Hz; None: the robot does not say it
    apart: bool  # its pictures are read from the camera itself, and not with the state


class DeviceFacts(NamedTuple):
    """The robot's facts about itself, known once it is connected."""

    kind: str  # "so101_follower"
    id: str  # "" without one
    axes: tuple[AxisFacts, ...]
    cameras: tuple[CameraFacts, ...]
    has_torque: bool  # its motors can be switched off


class Shots(Protocol):
    """A camera that is read apart from the robot's state."""

    def read(self) -> Any:
        """Wait for a picture that was not read before; return it, height x width x 3, uint8, RGB.

        Raises:
            Exception: none came.
        """


class Device(Protocol):
    """A connected robot. `observe`, `act`, `torque` and `disconnect` are called by one thread and may block."""

    @property
    def facts(self) -> DeviceFacts: ...

    def camera(self, name: str) -> Shots:
        """Return a camera that is read apart, for a thread that reads nothing else."""

    def observe(self) -> Mapping[str, Any]:
        """Read the state, and the pictures of the cameras that are not apart."""

    def act(self, action: dict[str, float]) -> None:
        """Send the goals."""

    def torque(self, on: bool) -> None:
        """Switch the motors on or off."""

    def disconnect(self, *, torque_off: bool) -> None:
        """Let the robot go."""
