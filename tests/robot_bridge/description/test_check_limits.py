import math

import msgspec
import pytest

from lockstep.protocol.description import AxisGain, Geofence, PlanarBase, PositionLimit, RobotDescription
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

LIMIT = PositionLimit(name="l", label="L", joint="base.x", minimum=-1.0, maximum=1.0, axes=(AxisGain(axis="base.vx"),))
FENCE = Geofence(name="f", label="F", kind="keep_out", polygon=((0, 0), (1, 0), (0, 1)))
BASE = DESCRIPTION.planar_base
assert BASE is not None


def limited(**changes: object) -> RobotDescription:
    return msgspec.structs.replace(DESCRIPTION, position_limits=(msgspec.structs.replace(LIMIT, **changes),))


def fenced(**changes: object) -> RobotDescription:
    return msgspec.structs.replace(DESCRIPTION, geofences=(msgspec.structs.replace(FENCE, **changes),))


def based(base: PlanarBase | None, **changes: object) -> RobotDescription:
    changed = None if base is None else msgspec.structs.replace(base, **changes)
    return msgspec.structs.replace(DESCRIPTION, planar_base=changed)


def test_sound_limits_pass() -> None:
    check_description(limited())
    check_description(limited(minimum=None))
    check_description(fenced(polygon=((0, 0), (2, 0), (2, 2), (1, 1), (0, 2))))
    check_description(based(BASE, left="", turn=""))


@pytest.mark.parametrize(
    ("description", "message"),
    [
        (limited(joint="elbow"), "the joint 'elbow'"),
        (limited(axes=()), "needs the axes"),
        (limited(axes=(AxisGain(axis="nil"),)), "the axis 'nil'"),
        (limited(axes=(AxisGain(axis="base.vx"), AxisGain(axis="base.vx"))), "each once"),
        (limited(axes=(AxisGain(axis="base.vx", gain=0.0),)), "not 0"),
        (limited(axes=(AxisGain(axis="base.vx", gain=math.nan),)), "not 0"),
        (limited(axes=(AxisGain(axis="base.vx", gain=None), AxisGain(axis="base.vy"))), "either all gains"),
        (limited(minimum=None, maximum=None), "a minimum or a maximum"),
        (limited(maximum=math.inf), "finite"),
        (limited(margin=1.1), "no room"),
        (limited(margin=-0.1), "margin"),
        (limited(latency=2.0), "latency"),
        (limited(latency=math.nan), "latency"),
        (limited(name=""), "limit name ''"),
        (limited(name="room"), "limit name 'room'"),
        (based(None), "planar_base"),
        (based(BASE, x="nowhere"), "the joint 'nowhere'"),
        (based(BASE, forward=""), "the axis ''"),
        (based(BASE, left="base.vx"), "named twice"),
        (based(BASE, radius=-1.0), "radius"),
        (fenced(polygon=((0, 0), (1, 0))), "corners"),
        (fenced(polygon=tuple((math.cos(k), math.sin(k)) for k in range(65))), "corners"),
        (fenced(polygon=((0, 0), (1, 0), (math.nan, 1))), "finite"),
        (fenced(polygon=((0, 0), (0, 0), (1, 1))), "successive corners"),
        (fenced(polygon=((0, 0), (1, 1), (1, 0), (0, 1))), "cross"),
        (fenced(polygon=((0, 0), (1, 1), (2, 2))), "no area"),
        (msgspec.structs.replace(DESCRIPTION, geofences=(FENCE,) * 33), "33 geofences"),
    ],
)
def test_a_contradiction_is_named(description: RobotDescription, message: str) -> None:
    with pytest.raises(DescriptionError, match=message.replace("(", r"\(")):
        check_description(description)
