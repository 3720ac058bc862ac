"""Reads and writes fields of ROS messages by their path, "target.speed". No I/O."""

import math
from collections.abc import Collection
from typing import Any

from lockstep.protocol.actions import ParameterValue
from lockstep.robot_bridge.errors import RobotUnavailable

__all__ = ["BadField", "number_at", "put_pose", "set_field", "text_at"]


class BadField(RobotUnavailable):
    """A message has no such field, or it is of another kind."""


def value_at(message: Any, path: str) -> Any:
    """Return the value of a field.

    Raises:
        BadField: there is none.
    """
    for name in path.split("."):
        if not hasattr(message, "get_fields_and_field_types") or name not in message.get_fields_and_field_types():
            raise BadField(f"{type(message).__name__} has no field {name!r} ({path})")
        message = getattr(message, name)
    return message


def set_field(message: Any, path: str, value: ParameterValue) -> None:
    """Write a field. A number becomes what the field takes: whole numbers are rounded.

    Raises:
        BadField: there is no such field, or it takes no such value.
    """
    before = value_at(message, path)
    parent, _, name = path.rpartition(".")
    owner = value_at(message, parent) if parent else message
    given: Any = value
    if isinstance(before, bool) != isinstance(value, bool) or isinstance(before, str) != isinstance(value, str):
        raise BadField(f"the field {path} takes {type(before).__name__}, not {value!r}")
    if isinstance(before, int) and not isinstance(before, bool) and isinstance(value, float | int):
        given = round(value)
    elif isinstance(before, float) and isinstance(value, float | int):
        given = float(value)
    elif not isinstance(before, bool | str):
        raise BadField(f"the field {path} is no number, text or switch")
    try:
        setattr(owner, name, given)
    except (AssertionError, ValueError, TypeError) as error:  # rclpy checks ranges with assertions
        raise BadField(f"the field {path} does not take {value!r}: {error}") from error


def number_at(message: Any, path: str) -> float:
    """Return a number; the length of a sequence.

    Raises:
        BadField: the field is not there, is none, or is not finite.
    """
    value = value_at(message, path)
    if isinstance(value, Collection) and not isinstance(value, str):
        return float(len(value))
    if isinstance(value, str) or not math.isfinite(value):
        raise BadField(f"the field {path} is no number")
    return float(value)


def text_at(message: Any, path: str) -> str:
    """Return a field in words.

    Raises:
        BadField: it is not there.
    """
    value = value_at(message, path)
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value if isinstance(value, bool | int | str) else list(value) if isinstance(value, Collection) else value)


def put_pose(message: Any, path: str, x: float, y: float, yaw: float, frame: str, stamp: Any) -> None:
    """Write a geometry_msgs/PoseStamped.

    Raises:
        BadField: the field is none.
    """
    stamped = value_at(message, path)
    try:
        stamped.header.frame_id, stamped.header.stamp = frame, stamp
        stamped.pose.position.x, stamped.pose.position.y = float(x), float(y)
        stamped.pose.orientation.z, stamped.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    except AttributeError as error:
        raise BadField(f"the field {path} is no geometry_msgs/PoseStamped: {error}") from error
