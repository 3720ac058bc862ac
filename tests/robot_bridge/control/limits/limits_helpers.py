"""A robot that is nothing but its limits: it moves exactly as told, and knows where it is as long as it is told to."""

import math
from collections.abc import Sequence

from lockstep.protocol.description import Axis, AxisGain, Geofence, Joint, PlanarBase, PositionLimit, RobotDescription
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.limits.motion_limits import MotionLimits
from lockstep.robot_bridge.description.check_description import check_description

__all__ = ["DT", "HOLD", "LIFT", "ExactBase", "ExactLift", "base_description", "inside"]

DT = 0.004
HOLD = 0.3
Polygon = Sequence[tuple[float, float]]

LIFT = RobotDescription(
    name="lift",
    label="Lift",
    axes=(
        Axis(name="coarse", label="Coarse", unit="m/s", minimum=-1, maximum=1, slew=4, brake=8),
        Axis(name="fine", label="Fine", unit="m/s", minimum=-0.1, maximum=0.1, slew=1, brake=2),
    ),
    joints=(Joint(name="height", unit="m"),),
    position_limits=(
        PositionLimit(
            name="height.range",
            label="Height",
            joint="height",
            minimum=0.0,
            maximum=1.0,
            axes=(AxisGain(axis="coarse", gain=-0.5), AxisGain(axis="fine")),
        ),
    ),
)


def base_description(
    *zones: tuple[str, Polygon], radius: float = 0.0, left: str = "vy", brake: float = 8.0
) -> RobotDescription:
    """A base with the zones ("keep_in" or "keep_out", corners)."""
    description = RobotDescription(
        name="base",
        label="Base",
        axes=(
            Axis(name="vx", label="Forward", unit="m/s", minimum=-1, maximum=1, slew=4, brake=brake),
            Axis(name="vy", label="Left", unit="m/s", minimum=-1, maximum=1, slew=4, brake=brake),
            Axis(name="wz", label="Turn", unit="rad/s", minimum=-2, maximum=2, slew=8, brake=15),
        ),
        joints=(Joint(name="x", unit="m"), Joint(name="y", unit="m"), Joint(name="yaw", unit="rad")),
        planar_base=PlanarBase(x="x", y="y", yaw="yaw", forward="vx", left=left, turn="wz", radius=radius),
        geofences=tuple(
            Geofence(name=f"zone {number}", label=f"Zone {number}", kind=kind, polygon=tuple(corners))  # type: ignore[arg-type]
            for number, (kind, corners) in enumerate(zones)
        ),
    )
    check_description(description)
    return description


class Exact:
    """Shaper and limits around an exact integrator, tick by tick."""

    def __init__(self, description: RobotDescription, place: Sequence[float]) -> None:
        self.place = list(place)  # position of each joint
        self.axes = description.axes
        self.known = True
        self.now = 0.0
        self.limits = MotionLimits(description, self, DT)
        self.shaper = AxisShaper(description.axes, hold=HOLD, limiter=self.limits)
        self.values = self.shaper.values

    def positions(self) -> Sequence[float]:
        return self.place if self.known else [math.nan] * len(self.place)

    def joint_rates(self, values: Sequence[float]) -> Sequence[float] | None:
        return None

    def drive(self, values: Sequence[float], ticks: int) -> None:
        """Command the same at every tick."""
        for _ in range(ticks):
            self.shaper.drive(values, self.now)
            self.tick()

    def tick(self) -> None:
        before = self.values
        self.values = self.shaper.step(self.now, DT)
        self.check_ramp(before)
        self.now += DT
        self.move()

    def check_ramp(self, before: Sequence[float]) -> None:
        """No limit makes an axis come to rest faster than its brake, nor speed up faster than its slew."""
        for number, old in enumerate(before):
            axis = self.axes[number]
            assert abs(self.values[number] - old) <= max(axis.brake, axis.slew) * DT + 1e-9

    def move(self) -> None:
        raise NotImplementedError


class ExactLift(Exact):
    def __init__(self, height: float, description: RobotDescription = LIFT) -> None:
        super().__init__(description, [height])

    @property
    def height(self) -> float:
        return self.place[0]

    def move(self) -> None:
        self.place[0] += (-0.5 * self.values[0] + self.values[1]) * DT


class ExactBase(Exact):
    """Turns first and moves then, within each tick."""

    def move(self) -> None:
        vx, vy, wz = self.values
        self.place[2] += wz * DT
        cos, sin = math.cos(self.place[2]), math.sin(self.place[2])
        self.place[0] += (cos * vx - sin * vy) * DT
        self.place[1] += (sin * vx + cos * vy) * DT


def inside(corners: Polygon, x: float, y: float) -> bool:
    """Even-odd rule, written down a second time on purpose."""
    found = False
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (ay > y) != (by > y) and x < ax + (bx - ax) * (y - ay) / (by - ay):
            found = not found
    return found
