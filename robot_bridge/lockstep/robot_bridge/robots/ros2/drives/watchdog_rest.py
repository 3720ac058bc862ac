"""Publishes zero to a ROS 2 robot from the watchdog's process, by a separate node, also when the bridge was killed.

A base gets a zero twist, a controller of velocities zeros. An arm that gets positions stays at the last one
(docs/ros2.md) and needs nothing.
"""

from collections.abc import Callable
from typing import Any

import msgspec

from lockstep.robot_bridge.robots.ros2.drives.arm_drive import PACKAGES, velocities_message
from lockstep.robot_bridge.robots.ros2.drives.twists import TwistMaker
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import Arm, Base, Ros2Settings
from lockstep.robot_bridge.watchdog.watchdog_process import Act

__all__ = ["REST_CALL", "needs_zero", "prepare", "rest_arguments"]

REST_CALL = f"{__name__}:prepare"

_read_settings = msgspec.json.Decoder(Ros2Settings)


def needs_zero(part: Base | Arm) -> bool:
    """Return whether a part goes on moving after its last command until it is told zero."""
    return isinstance(part, Base) or part.command.message == "Float64MultiArray"


def rest_arguments(settings: Ros2Settings, base_topic: str | None, arm_topic: str | None) -> tuple[str, ...]:
    """Return the arguments of `prepare`; none if no part needs it.

    The topics are the full names of the parts' command topics, since the process has a node of another name.
    """
    base, arm = settings.base, settings.arm
    if base is None or base_topic is None or not needs_zero(base):
        base = None
    else:
        base = msgspec.structs.replace(base, command=msgspec.structs.replace(base.command, topic=base_topic))
    if arm is None or arm_topic is None or not needs_zero(arm):
        arm = None
    else:
        arm = msgspec.structs.replace(arm, command=msgspec.structs.replace(arm.command, topic=arm_topic))
    if base is None and arm is None:
        return ()
    own = Ros2Settings(
        name=settings.name,
        domain=settings.domain,
        node=f"{settings.node}_watchdog",
        use_sim_time=settings.use_sim_time,
        base=base,
        arm=arm,
    )
    return (msgspec.json.encode(own).decode(),)


def prepare(encoded: str) -> Act:
    """Return the function that publishes zero.

    The publishers are made now, because subscribers need time to find them.

    Raises:
        RobotUnavailable: ROS 2 does not start.
    """
    settings = _read_settings.decode(encoded)
    ros = RosSide(settings)
    zeros: list[tuple[Any, Callable[[], Any]]] = []  # publisher, and what makes its message
    if settings.base is not None:
        twists = TwistMaker(ros, settings.base.command)
        zeros.append((ros.publisher(twists.kind, settings.base.command.topic), lambda: twists.make(0.0, 0.0, 0.0)))
    if settings.arm is not None:
        command, still = settings.arm.command, [0.0] * len(settings.arm.joints)
        kind = ros.message(PACKAGES[command.message], command.message)
        zeros.append((ros.publisher(kind, command.topic), lambda: velocities_message(kind, still)))

    def rest() -> bool:
        # Subscribers and these publishers have found each other.
        is_heard = all(publisher.get_subscription_count() > 0 for publisher, _ in zeros)
        for publisher, make in zeros:
            publisher.publish(make())
        ros.flush()
        return is_heard

    return rest
