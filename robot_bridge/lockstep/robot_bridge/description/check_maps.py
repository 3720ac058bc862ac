"""Checks the parts of a description that name an action by which a person points at a place: on a map, in a picture."""

import math

from lockstep.protocol.description import Action, RobotDescription
from lockstep.robot_bridge.errors import DescriptionError

__all__ = ["check_clicks", "check_map"]

GOAL = frozenset(("x", "y"))  # parameters that the action has to have
GOAL_MAY = GOAL | {"yaw"}
CLICK = frozenset(("x", "y", "event"))


def check_map(description: RobotDescription) -> None:
    """Check that the robot can be shown on its map, and sent to a place.

    Raises:
        DescriptionError: names the first contradiction found.
    """
    view = description.map
    if view is None:
        return
    joints = {joint.name for joint in description.joints}
    for name in (view.x, view.y, view.yaw):
        if name not in joints:
            raise DescriptionError(f"map names the joint {name!r}, which is not described")
    if len({view.x, view.y, view.yaw}) != 3:
        raise DescriptionError("map needs three joints for x, y and yaw")
    if not (math.isfinite(view.radius) and 0 < view.radius <= 100):
        raise DescriptionError(f"map: radius must be in (0, 100] m, not {view.radius}")
    if not view.goal:
        return
    names = _numbers_of(_action(description, view.goal, "map"), "map")
    if not GOAL <= names <= GOAL_MAY:
        raise DescriptionError(f"map: the action {view.goal} needs the numbers x and y, may have yaw, and no other")


def check_clicks(description: RobotDescription) -> None:
    """Check the actions that clicks on pictures ask for.

    Raises:
        DescriptionError: names the first contradiction found.
    """
    for camera in description.cameras:
        if camera.click:
            where = f"camera {camera.name}"
            if _numbers_of(_action(description, camera.click, where), where) != CLICK:
                raise DescriptionError(f"{where}: the action {camera.click} needs the numbers x, y and event alone")


def _action(description: RobotDescription, name: str, where: str) -> Action:
    action = next((each for each in description.actions if each.name == name), None)
    if action is None:
        raise DescriptionError(f"{where} names the action {name!r}, which is not described")
    if action.confirm:
        raise DescriptionError(f"{where}: the action {name} asks a question, which a click cannot answer")
    return action


def _numbers_of(action: Action, where: str) -> set[str]:
    if any(parameter.kind != "number" for parameter in action.parameters):
        raise DescriptionError(f"{where}: the parameters of the action {action.name} have to be numbers")
    return {parameter.name for parameter in action.parameters}
