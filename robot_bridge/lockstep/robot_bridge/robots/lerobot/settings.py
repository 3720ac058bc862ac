"""The settings in the YAML file of a LeRobot robot. docs/lerobot.md explains them to users."""

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field

from lockstep.protocol.description import Body, ControlLayer

__all__ = ["AxisSettings", "CameraSettings", "LeRobotSettings"]

Name = Annotated[str, Meta(min_length=1, max_length=100)]
Positive = Annotated[float, Meta(gt=0, le=1e6)]
NotNegative = Annotated[float, Meta(ge=0, le=1e6)]
Seconds = Annotated[float, Meta(ge=0, le=2)]


class AxisSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One entry of the robot's action. None: as the robot says, or the default of its unit."""

    label: str | None = None
    kind: Literal["goal", "rate"] | None = None  # None: by the name, `.pos` or `.vel`
    unit: Annotated[str, Meta(max_length=20)] | None = None
    minimum: float | None = None
    maximum: float | None = None
    slew: Positive | None = None  # unit/s, the largest speed of a goal
    acceleration: Positive | None = None  # unit/s^2
    brake: Positive | None = None  # unit/s^2 of a goal, unit/s of a rate
    reach: Positive | None = None  # unit
    wrap: Positive | None = None  # unit, the period of an axis that turns on and on


class CameraSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    label: str | None = None
    latency: Seconds | None = None  # s from the exposure until LeRobot has the picture; None: see `description`
    frame_rate: Annotated[float, Meta(gt=0, le=240)] | None = None  # Hz; None: as configured, else 30
    timeout: Annotated[float, Meta(gt=0, le=60)] = 2.0  # s without a picture until that is a fault


class LeRobotSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """All of the file. The flags of the command line come on top of `config`."""

    robot: str = ""  # LeRobot's type, "so101_follower"; or "module:Class"; "": the command line says it
    config: dict[str, Any] = {}  # fields of the type's configuration: port, id, cameras …
    name: Name | None = None  # None: the type, and the id if there is one
    label: str | None = None
    rate: Annotated[float, Meta(ge=1, le=500)] = 50.0  # Hz, of reading the state and sending the goals
    timeout: Annotated[float, Meta(gt=0, le=10)] = 0.5  # s without a new state until it counts as unknown
    still: Positive = 1.0  # unit within 0.2 s, below which an axis counts as at rest
    stop: Literal["hold", "torque_off"] = "hold"  # what a latched stop does once the arm stands, and the bridge's end
    hold: Annotated[float, Meta(ge=0.05, le=5)] = 0.5
    watchdog: Annotated[float, Meta(gt=0, le=5)] = 0.2  # s without a tick after which the goals stay as they are
    max_event_age: Annotated[float, Meta(gt=0, le=10)] = 2.0
    max_event_rate: Annotated[float, Meta(gt=0, le=100)] = 25.0
    axes: dict[str, AxisSettings] = {}  # by the name in `action_features`
    cameras: dict[str, CameraSettings] = {}
    layers: tuple[ControlLayer, ...] = ()  # (): made for the axes
    bodies: tuple[Body, ...] = field(default=())
