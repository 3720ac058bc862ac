"""Reads which servos of a model are driven by goals: `<custom><text name="lockstep_goals" data="…"/></custom>`."""

from collections.abc import Sequence
from typing import Any, Final

from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.robots.mjcf.actuators import Actuator, Kind
from lockstep.robot_bridge.robots.mjcf.texts import words_of

__all__ = ["goal_actuators"]

TEXT: Final = "lockstep_goals"
ALL: Final = "all"


def goal_actuators(model: Any, actuators: Sequence[Actuator]) -> set[int]:
    """Return the numbers of the position servos that are goal axes.

    Raises:
        ModelError: the text names an actuator that does not exist or cannot be one.
    """
    words = words_of(model, TEXT)
    servos = {each.name: each for each in actuators if each.kind is Kind.POSITION and each.joint is not None}
    if words == [ALL]:
        return {each.number for each in servos.values()}
    for word in words:
        if word not in servos:
            known = ", ".join(servos) or "none"
            raise ModelError(f"{TEXT} names {word!r}, which is no position actuator of a joint; there are: {known}")
    return {servos[word].number for word in words}
