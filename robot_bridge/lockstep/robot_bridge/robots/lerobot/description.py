"""Makes the robot description from what a robot of LeRobot says of itself and its settings. No I/O."""

from collections.abc import Iterable
from typing import Final, Literal, NamedTuple

from lockstep.protocol.description import Axis, Camera, Joint, RobotDescription
from lockstep.robot_bridge.robots.lerobot.device import AxisFacts, CameraFacts, DeviceFacts, Norm
from lockstep.robot_bridge.robots.lerobot.settings import AxisSettings, CameraSettings, LeRobotSettings
from lockstep.robot_bridge.robots.ros2.controls import arm_layers
from lockstep.robot_bridge.yaml_file import SettingsPlace

__all__ = ["DEGREES", "camera_latency", "describe"]

DEGREES: Final = "deg"
APART_LATENCY = 0.05  # s; a USB camera's exposure and transfer
TOGETHER_LATENCY = 0.5  # s; the oldest picture that LeRobot's cameras hand out with the state
FRAME_RATE = 30.0  # Hz
RISE = 0.5  # s to full speed
MAX_FRAME_RATE = 240.0


class _Unit(NamedTuple):
    """The limits of an axis with a certain unit, unless the settings say otherwise."""

    unit: str
    minimum: float | None
    maximum: float | None
    slew: float  # unit/s
    reach: float


_GOALS: Final[dict[Norm, _Unit]] = {
    "degrees": _Unit(DEGREES, None, None, 60.0, 30.0),
    "range_m100_100": _Unit("%", -100.0, 100.0, 50.0, 25.0),
    "range_0_100": _Unit("%", 0.0, 100.0, 100.0, 100.0),  # grippers: the goal lies within what they grasp
}
_RATES: Final = {  # the twist of LeKiwi's base
    "x.vel": _Unit("m/s", -0.3, 0.3, 0.6, 0.0),
    "y.vel": _Unit("m/s", -0.3, 0.3, 0.6, 0.0),
    "theta.vel": _Unit("deg/s", -90.0, 90.0, 180.0, 0.0),
}


def describe(settings: LeRobotSettings, facts: DeviceFacts) -> RobotDescription:
    """Return the description; each entry of the robot's action becomes an axis of the same name.

    Raises:
        SettingsPlace: something is missing or contradicts the robot; names the setting.
    """
    _check_names("axes", settings.axes, {axis.name for axis in facts.axes})
    _check_names("cameras", settings.cameras, {camera.name for camera in facts.cameras})
    if settings.stop == "torque_off" and not facts.has_torque:
        raise SettingsPlace(("stop",), f"{facts.kind} has no motor bus whose torque can be switched off")
    axes = tuple(_axis(each, settings.axes.get(each.name, AxisSettings()), settings.hold) for each in facts.axes)
    kind = facts.kind.replace("_", "-")
    return RobotDescription(
        name=settings.name or (f"{kind}-{facts.id}" if facts.id else kind),
        label=settings.label or facts.kind.replace("_", " ").capitalize(),
        axes=axes,
        joints=tuple(_joint(axis) for axis in axes if axis.kind == "goal" and axis.unit == DEGREES),
        layers=settings.layers or arm_layers(axes),
        cameras=tuple(_camera(each, settings.cameras.get(each.name, CameraSettings())) for each in facts.cameras),
        bodies=settings.bodies,
        hold=settings.hold,
        watchdog=min(settings.watchdog, settings.hold / 2),
        max_event_age=settings.max_event_age,
        max_event_rate=settings.max_event_rate,
    )


def camera_latency(facts: CameraFacts, settings: CameraSettings) -> float:
    """Return how old a picture may be when LeRobot hands it out, in s."""
    if settings.latency is not None:
        return settings.latency
    return APART_LATENCY if facts.apart else TOGETHER_LATENCY


def _check_names(key: str, given: Iterable[str], known: set[str]) -> None:
    for name in sorted(set(given) - known):
        raise SettingsPlace((key, name), f"the robot has no such entry; there are {', '.join(sorted(known)) or 'none'}")


def _axis(facts: AxisFacts, given: AxisSettings, hold: float) -> Axis:
    kind: Literal["goal", "rate"] = given.kind or ("rate" if facts.name.endswith(".vel") else "goal")
    default = _RATES.get(facts.name) if kind == "rate" else (None if facts.norm is None else _GOALS[facts.norm])
    unit = given.unit if given.unit is not None else (None if default is None else default.unit)
    if unit is None:
        raise _missing(facts, "unit")
    minimum = _needed(facts, "minimum", given.minimum, facts.minimum, default and default.minimum)
    maximum = _needed(facts, "maximum", given.maximum, facts.maximum, default and default.maximum)
    slew = _needed(facts, "slew", given.slew, default and default.slew)
    reach = 0.0 if kind == "rate" else _needed(facts, "reach", given.reach, default and default.reach)
    if kind == "goal" and not facts.observed:
        raise SettingsPlace(("axes", facts.name), "the robot does not observe it: a goal axis needs a measured value")
    return Axis(
        name=facts.name,
        label=given.label or facts.name.rpartition(".")[0].replace("_", " ").capitalize() or facts.name,
        unit=unit,
        minimum=minimum,
        maximum=maximum,
        slew=slew,
        acceleration=0.0 if kind == "rate" else given.acceleration or slew / RISE,
        brake=given.brake or _brake(kind, maximum, slew, hold),
        kind=kind,
        reach=reach,
        wrap=given.wrap,
        grips=kind == "goal" and facts.norm == "range_0_100",
    )


def _brake(kind: str, maximum: float, slew: float, hold: float) -> float:
    """Return what brings the axis from full speed to rest in half of `hold`."""
    return (slew if kind == "goal" else maximum) / (hold / 2)


def _needed(facts: AxisFacts, key: str, *values: float | None) -> float:
    """Return the first value that is known."""
    for value in values:
        if value is not None:
            return value
    raise _missing(facts, key)


def _missing(facts: AxisFacts, key: str) -> SettingsPlace:
    return SettingsPlace(("axes", facts.name, key), "the robot does not say it: it has to be given")


def _joint(axis: Axis) -> Joint:
    return Joint(name=axis.name.rpartition(".")[0] or axis.name, unit="rad")


def _camera(facts: CameraFacts, given: CameraSettings) -> Camera:
    return Camera(
        name=facts.name,
        label=given.label or facts.name.replace("_", " ").capitalize(),
        width=facts.width - facts.width % 2,
        height=facts.height - facts.height % 2,
        frame_rate=min(given.frame_rate or facts.frame_rate or FRAME_RATE, MAX_FRAME_RATE),
    )
