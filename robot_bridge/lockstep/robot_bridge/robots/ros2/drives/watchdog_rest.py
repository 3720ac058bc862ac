"""Publishes zero to a ROS 2 base from the watchdog's process, by a separate node, also when the bridge was killed.

An arm gets no zero: it gets positions, and stays at the last one (docs/ros2.md).
"""

import msgspec

from lockstep.robot_bridge.robots.ros2.drives.twists import TwistMaker
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import Base, Ros2Settings
from lockstep.robot_bridge.watchdog.watchdog_process import Act

__all__ = ["REST_CALL", "prepare", "rest_arguments"]

REST_CALL = f"{__name__}:prepare"

_read_settings = msgspec.json.Decoder(Ros2Settings)


def rest_arguments(settings: Ros2Settings, base: Base, topic: str) -> tuple[str, ...]:
    """Return the arguments of `prepare`. `topic`: the full name, since the process has a node of another name."""
    command = msgspec.structs.replace(base.command, topic=topic)
    own = Ros2Settings(
        name=settings.name,
        domain=settings.domain,
        node=f"{settings.node}_watchdog",
        use_sim_time=settings.use_sim_time,
        base=msgspec.structs.replace(base, command=command),
    )
    return (msgspec.json.encode(own).decode(),)


def prepare(encoded: str) -> Act:
    """Return the function that publishes zero.

    The publisher is made now, because subscribers need time to find it.

    Raises:
        RobotUnavailable: ROS 2 does not start.
    """
    settings = _read_settings.decode(encoded)
    if settings.base is None:
        raise ValueError("a base was meant to be brought to rest")
    ros = RosSide(settings)
    twists = TwistMaker(ros, settings.base.command)
    publisher = ros.publisher(twists.kind, settings.base.command.topic)

    def rest() -> bool:
        is_heard: bool = publisher.get_subscription_count() > 0  # subscribers and this publisher have found each other
        publisher.publish(twists.make(0.0, 0.0, 0.0))
        ros.flush()
        return is_heard

    return rest
