"""The robot's limits: the range of each arm joint, the room, and the charging corner."""

from collections.abc import Sequence
from typing import Final

from lockstep.protocol.description import AxisGain, Geofence, Joint, PlanarBase, PositionLimit
from lockstep.robot_bridge.robots.mobile_manipulator.controls import AXES
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import ARM

__all__ = ["BASE_ON_FLOOR", "GEOFENCES", "arm_limits"]

SERVO_LEAD: Final = 0.02  # rad by which a servo may run on when its target stops

BASE_ON_FLOOR: Final = PlanarBase(
    x="base.x",
    y="base.y",
    yaw="base.yaw",
    forward="base.vx",
    left="base.vy",
    turn="base.wz",
    radius=0.32,  # the drum; the arm may reach out of the zones
    margin=0.03,  # wheels slip
    latency=0.02,  # s by which the motors follow a falling command later
)

GEOFENCES: Final = (
    Geofence(  # 0.1 m behind the walls' faces: they may be touched, not passed
        name="room", label="Room", kind="keep_in", polygon=((-2.6, -2.8), (3.6, -2.8), (3.6, 2.8), (-2.6, 2.8))
    ),
    Geofence(
        name="charger",
        label="Charging corner",
        kind="keep_out",
        polygon=((-2.6, -2.8), (-1.6, -2.8), (-1.6, -1.9), (-2.6, -1.9)),
    ),
)


def arm_limits(joints: Sequence[Joint]) -> tuple[PositionLimit, ...]:
    """Return a limit for each joint of the arm that has a range. The tool's twist moves all of them, by the posture."""
    tool = tuple(AxisGain(axis=axis.name, gain=None) for axis in AXES if axis.name.startswith("tool."))
    return tuple(
        PositionLimit(
            name=joint.name,
            label=f"{joint.name.removeprefix('arm.').capitalize()} range",
            joint=joint.name,
            minimum=joint.minimum,
            maximum=joint.maximum,
            axes=tool,
            margin=SERVO_LEAD,
        )
        for joint in joints[ARM]
        if joint.minimum is not None or joint.maximum is not None
    )
