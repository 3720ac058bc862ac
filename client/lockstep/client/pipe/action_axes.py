"""Which axes of a robot an action of LeRobot has. No I/O."""

from collections.abc import Mapping

from lockstep.protocol.description import Pose, RobotDescription

__all__ = ["action_axes", "without_doubles"]


def action_axes(description: RobotDescription) -> list[str]:
    """Return the axes of an action: all but those of poses that stand in for joints.

    While a pose is driven the goals of its joints follow it, so they say all that happens, and a command that gave both
    would be refused.
    """
    doubled = {axis for pose in description.poses if pose.instead_of for axis in _axes(pose)}
    return [axis.name for axis in description.axes if axis.name not in doubled]


def without_doubles(description: RobotDescription, values: Mapping[str, float]) -> dict[str, float]:
    """Return the values without those of each pose some of whose joints are given too: the joints count."""
    dropped = {
        axis for pose in description.poses if not values.keys().isdisjoint(pose.instead_of) for axis in _axes(pose)
    }
    return {name: value for name, value in values.items() if name not in dropped}


def _axes(pose: Pose) -> tuple[str, ...]:
    return (*pose.position, *pose.rotation)
