"""Publishes zero to a ROS 2 robot from the watchdog's process, by a separate node, also when the bridge was killed.

A base and a tool get a zero twist, a controller of velocities zeros. Goals of actions that move the robot are
cancelled. An arm that gets positions stays at the last one (docs/ros2.md) and needs nothing.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import msgspec

from lockstep.robot_bridge.robots.ros2.description import SERVO_AXES
from lockstep.robot_bridge.robots.ros2.drives.arm_drive import PACKAGES, takes_velocities, velocities_message
from lockstep.robot_bridge.robots.ros2.drives.servo_drive import tool_twist
from lockstep.robot_bridge.robots.ros2.drives.twists import TwistMaker
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import Ros2Settings, RosAction
from lockstep.robot_bridge.watchdog.watchdog_process import Act

__all__ = ["REST_CALL", "prepare", "rest_arguments"]

CANCELS = "action_msgs/CancelGoal"  # stands for the type of an action, which the process does not need
REST_CALL = f"{__name__}:prepare"

_read_settings = msgspec.json.Decoder(Ros2Settings)


def rest_arguments(
    settings: Ros2Settings,
    *,
    base: str | None,
    arm: str | None,
    servo: str | None,
    actions: Sequence[str] = (),
) -> tuple[str, ...]:
    """Return the arguments of `prepare`; none if every part stays where it is without a word.

    `base`, `arm`, `servo`: the full names of the parts' command topics, since the process has a node of another name;
    None for a part that the robot does not have. `actions`: full names of action servers whose goals move the robot.
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
    own = replace(own, actions=tuple(RosAction(name=name, action=name, type=CANCELS) for name in actions))
    if own.base is None and own.arm is None and own.servo is None and not own.actions:
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
        kind = ros.interface(f"{PACKAGES[settings.arm.command.message]}/msg/{settings.arm.command.message}")
        still = [0.0] * len(settings.arm.joints)
        zeros.append((ros.publisher(kind, settings.arm.command.topic), partial(velocities_message, kind, still)))
    if settings.servo is not None:
        command, kind = settings.servo.command, ros.interface("geometry_msgs/msg/TwistStamped")
        still = [0.0] * len(SERVO_AXES)
        zeros.append((ros.publisher(kind, command.topic), partial(tool_twist, ros, kind, command, still)))

    cancels = ros.interface("action_msgs/srv/CancelGoal")
    cancelling = [ros.client(cancels, f"{action.action}/_action/cancel_goal") for action in settings.actions]

    def rest() -> bool:
        # Subscribers and these publishers have found each other.
        is_heard = all(publisher.get_subscription_count() > 0 for publisher, _ in zeros)
        for client in cancelling:
            if client.service_is_ready():
                client.call_async(cancels.Request())  # no id and no time: all goals (rcl_interfaces, CancelGoal)
            elif not zeros:
                is_heard = False
        for publisher, make in zeros:
            publisher.publish(make())
        ros.flush()
        return is_heard

    return rest
