"""Publishes zero to a ROS 2 robot from the watchdog's process, by a separate node, also when the bridge was killed.

A base and a tool get a zero twist, a controller of velocities zeros. An arm that gets positions stays at the last one
(docs/ros2.md) and needs nothing.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec

from lockstep.robot_bridge.robots.ros2.description import SERVO_AXES
from lockstep.robot_bridge.robots.ros2.drives.arm_drive import PACKAGES, takes_velocities, velocities_message
from lockstep.robot_bridge.robots.ros2.drives.servo_drive import tool_twist
from lockstep.robot_bridge.robots.ros2.drives.twists import TwistMaker
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import Ros2Settings
from lockstep.robot_bridge.watchdog.watchdog_process import Act

__all__ = ["REST_CALL", "prepare", "rest_arguments"]

REST_CALL = f"{__name__}:prepare"

_read_settings = msgspec.json.Decoder(Ros2Settings)


def rest_arguments(settings: Ros2Settings, *, base: str | None, arm: str | None, servo: str | None) -> tuple[str, ...]:
    """Return the arguments of `prepare`; none if every part stays where it is without a word.

    `base`, `arm`, `servo`: the full names of the parts' command topics, since the process has a node of another name;
    None for a part that the robot does not have.
    """
    replace = msgspec.structs.replace
    own = Ros2Settings(
        name=settings.name,
        domain=settings.domain,
        node=f"{settings.node}_watchdog",
        use_sim_time=settings.use_sim_time,
    )
    if settings.base is not None and base is not None:
        own = replace(own, base=replace(settings.base, command=replace(settings.base.command, topic=base)))
    if settings.arm is not None and arm is not None and takes_velocities(settings.arm.command):
        own = replace(own, arm=replace(settings.arm, command=replace(settings.arm.command, topic=arm)))
    if settings.servo is not None and servo is not None:
        command = replace(settings.servo.command, topic=servo)
        own = replace(own, servo=replace(settings.servo, command=command))
    if own.base is None and own.arm is None and own.servo is None:
        return ()
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
        zeros.append((ros.publisher(twists.kind, settings.base.command.topic), partial(twists.make, 0.0, 0.0, 0.0)))
    if settings.arm is not None:
        kind = ros.message(PACKAGES[settings.arm.command.message], settings.arm.command.message)
        still = [0.0] * len(settings.arm.joints)
        zeros.append((ros.publisher(kind, settings.arm.command.topic), partial(velocities_message, kind, still)))
    if settings.servo is not None:
        command, kind = settings.servo.command, ros.message("geometry_msgs", "TwistStamped")
        still = [0.0] * len(SERVO_AXES)
        zeros.append((ros.publisher(kind, command.topic), partial(tool_twist, ros, kind, command, still)))

    def rest() -> bool:
        # Subscribers and these publishers have found each other.
        is_heard = all(publisher.get_subscription_count() > 0 for publisher, _ in zeros)
        for publisher, make in zeros:
            publisher.publish(make())
        ros.flush()
        return is_heard

    return rest
